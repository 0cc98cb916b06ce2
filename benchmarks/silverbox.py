"""Silverbox, measured: ``VIBROLOCK_DATA=FOLDER python -m benchmarks.silverbox``.

Two states, nine multisines for estimation, one chooses the iterate, the arrow (40 000 samples, half as large again as anything
in the estimation) is simulated at the end. Errors in mV RMS.
"""

import sys
import time

import numpy as np

from benchmarks.measured_data import SILVERBOX, Benchmark, path_of, silverbox
from identification import FitSettings, PnlssFit, identify_pnlss, pnlss_errors

DEGREES = ((3,), (2, 3))


def identified(data: Benchmark, degrees: tuple[int, ...], iterations: int) -> PnlssFit:
    return identify_pnlss(
        data.estimation,
        states=2,
        degrees=degrees,
        output_degrees=(),
        validation=data.validation,
        settings=FitSettings(iterations=iterations),
    )


def main() -> None:
    path = path_of(SILVERBOX)
    if path is None:
        sys.exit(f"set VIBROLOCK_DATA to a folder that holds {SILVERBOX} (public benchmark, not shipped)")
    data = silverbox(path)
    identified(data, (3,), 1)  # compiles
    print(
        f"{'degrees':10} {'estimation':>10} {'validation':>10} {'arrow':>7} {'range':>6} {'chosen':>7} {'s/iter':>7} {'total s':>8}"
    )
    for degrees in DEGREES:
        begin = time.perf_counter()
        found = identified(data, degrees, 60)
        total = time.perf_counter() - begin
        groups = [pnlss_errors(found.model, group) for group in (data.estimation, data.validation, data.test)]
        rms = [1e3 * float(np.sqrt(np.mean(errors.rms**2))) for errors in groups]
        each = float(np.mean(np.diff(found.history.seconds)))
        print(
            f"{'-'.join(map(str, degrees)):10} {rms[0]:10.4f} {rms[1]:10.4f} {rms[2]:7.4f} {groups[2].range_use[0]:6.2f} "
            f"{found.chosen:7d} {each:7.3f} {total:8.2f}"
        )


if __name__ == "__main__":
    main()
