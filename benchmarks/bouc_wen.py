"""Bouc-Wen, simulated hysteresis: ``VIBROLOCK_DATA=FOLDER python -m benchmarks.bouc_wen``.

Three states; the last eighth of the training multisine chooses the iterate, tests are only simulated. Errors as 20 log10 of
their RMS in m. Settings are the usual ones; twice the iterations and patience give up to 2.5 dB more. Noise of the averaged
training data is -108 dB; the tests have none.
"""

import sys
import time
from typing import Any

import numpy as np

from benchmarks.measured_data import BOUC_WEN, Benchmark, bouc_wen, path_of
from identification import FitSettings, PnlssFit, identify_pnlss, linear_pnlss, pnlss_errors

CASES: dict[str, dict[str, Any]] = {
    "degrees 2-3": {"degrees": (2, 3)},
    "degrees 2-3, no outputs": {"degrees": (2, 3), "output_degrees": ()},
    **{
        f"{count} saturating, seed {seed}": {"saturating": count, "seed": seed} for count in (10, 15) for seed in (0, 1)
    },
}


def identified(data: Benchmark, iterations: int, **asked: Any) -> PnlssFit:
    """The linear start from the whole period, the fit from seven eighths of it."""
    whole, estimation = data.estimation
    return identify_pnlss(
        [estimation],
        states=3,
        linear=linear_pnlss([whole], states=3),
        validation=data.validation,
        settings=FitSettings(iterations=iterations),
        **asked,
    )


def main() -> None:
    paths = [path_of(name) for name in BOUC_WEN]
    if None in paths:
        sys.exit(f"set VIBROLOCK_DATA to a folder that holds {' and '.join(BOUC_WEN)} (dynoNet, MIT, not shipped)")
    data = bouc_wen(*paths)  # type: ignore[arg-type]
    identified(data, 1, degrees=(2,)), identified(data, 1, saturating=1)  # compiles
    heads = ("multisine", "sweep", "range", "parameters", "chosen", "s/iter", "total s")
    print(f"{'':26}" + "".join(f"{head:>11}" for head in heads))
    for name, asked in CASES.items():
        begin = time.perf_counter()
        found = identified(data, 100, **asked)
        total = time.perf_counter() - begin
        errors = pnlss_errors(found.model, data.test)
        multisine, sweep = 20 * np.log10(errors.rms[:, 0])
        model = found.model
        count = 16 + model.nonlinear_coefficients + model.state_features.parameters + model.output_features.parameters
        each = float(np.mean(np.diff(found.history.seconds)))
        decibels = (f"{multisine:.1f}", f"{sweep:.1f}", f"{np.max(errors.range_use):.2f}")
        values = (*decibels, f"{count}", f"{found.chosen}", f"{each:.3f}", f"{total:.2f}")
        print(f"{name:26}" + "".join(f"{value:>11}" for value in values))


if __name__ == "__main__":
    main()
