"""Silverbox, measured: ``VIBROLOCK_DATA=FOLDER python -m benchmarks.silverbox``.

Two states, nine multisines for estimation, one chooses the iterate, the arrow (40 000 samples, half as large again as anything
in the estimation) is simulated at the end. Errors in mV RMS. A constant input makes up for the offset of the input: with degree
3 alone only in part, for a cube about another point has a square too.
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
    heads = ("degrees", "estimation", "validation", "arrow", "range", "chosen", "s/iter", "total s")
    print("".join(f"{head:>11}" for head in heads))
    for degrees in DEGREES:
        begin = time.perf_counter()
        found = identified(data, degrees, 60)
        total = time.perf_counter() - begin
        groups = [pnlss_errors(found.model, group) for group in (data.estimation, data.validation, data.test)]
        rms = [1e3 * float(np.sqrt(np.mean(errors.rms**2))) for errors in groups]
        each = float(np.mean(np.diff(found.history.seconds)))
        values = (
            *(f"{r:.4f}" for r in rms),
            f"{groups[2].range_use[0]:.2f}",
            f"{found.chosen}",
            f"{each:.3f}",
            f"{total:.2f}",
        )
        print("".join(f"{value:>11}" for value in ("-".join(map(str, degrees)), *values)))


if __name__ == "__main__":
    main()
