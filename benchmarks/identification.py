"""How long models and predictions take, as ratios within one run: ``python -m benchmarks.identification [--json]``.

Recordings are made first, on the virtual rigs. Each number is the median over interleaved rounds, so that what else the
machine does falls on all of them alike. The baseline is the virtual rig itself: a prediction of a sweep stands against the
simulation of that very sweep, an identification against the simulation of the test that it evaluates, and a sweep prediction
against the duration of the sweep too.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rig
from identification import (
    best_linear_approximation,
    identify_exciter,
    linear_modes,
    nonlinear_mode,
    predict_sweep,
    steady_predictions,
)

ROUNDS = 7
SWEEPS = {"magnet-beam": ("sweep-1", "sweep-2", "sweep-3"), "friction-beam": ("sweep-1", "sweep-2")}
FORCES_N = {"magnet-beam": (0.25, 0.55), "friction-beam": (2.0, 5.0, 15.0)}


@dataclass(frozen=True)
class Recorded:
    """A test of a virtual rig: its measurement, how long it lasted on the rig, how long its simulation took."""

    measured: Any
    duration_s: float
    simulation_s: float


def recorded(name: str, measurement: Callable[[Any], Any]) -> Recorded:
    with rig.run(name) as run:
        loops = [part.end["loop"] for part in run.recording.parts]
        samples = sum(loop["samples"] for loop in loops)
        rate_hz = run.recording.configuration["bench"]["sample_rate_hz"]
        return Recorded(measurement(run), samples / rate_hz, sum(loop["busy_s"] for loop in loops))


def jobs(bench: str) -> dict[str, tuple[Callable[[], Any], Recorded]]:
    """What is timed, each with the test that it belongs to."""
    modal = recorded(f"{bench}/modal", lambda run: next(iter(run.spectra().values())))
    shaken = recorded(f"{bench}/exciter", lambda run: next(iter(run.spectra().values())))
    backbone = recorded(f"{bench}/backbone", lambda run: run.backbone())
    modes = linear_modes(best_linear_approximation(modal.measured))
    mode = nonlinear_mode(backbone.measured, modes=modes)
    exciter = identify_exciter(shaken.measured, sample_rate_hz=5000.0)
    out: dict[str, tuple[Callable[[], Any], Recorded]] = {
        "linear_modes": (lambda: linear_modes(best_linear_approximation(modal.measured)), modal),
        "exciter": (lambda: identify_exciter(shaken.measured, sample_rate_hz=5000.0), shaken),
        "nonlinear_mode": (lambda: nonlinear_mode(backbone.measured, modes=modes), backbone),
        "frequency_responses": (lambda: steady_predictions(mode, FORCES_N[bench]), backbone),
    }
    for name in SWEEPS[bench]:
        sweep = recorded(f"{bench}/{name}", lambda run: next(iter(run.sweeps().values())))

        def predicted(sweep: Recorded = sweep) -> Any:
            return predict_sweep(mode, sweep.measured, exciter=exciter, linear_modes=modes)

        out[name] = (predicted, sweep)
    return out


def measure(bench: str) -> dict[str, dict[str, float]]:
    work = jobs(bench)
    for job, _ in work.values():
        job()  # compiles
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(ROUNDS):
        for name, (job, _) in work.items():
            start = time.perf_counter()
            job()
            seconds[name].append(time.perf_counter() - start)
    return {
        name: {
            "seconds": statistics.median(taken),
            "of_the_simulation": statistics.median(taken) / work[name][1].simulation_s,
            "times_real_time": work[name][1].duration_s / statistics.median(taken),
        }
        for name, taken in seconds.items()
    }


def main() -> None:
    results = {bench: measure(bench) for bench in SWEEPS}
    if "--json" in sys.argv:
        print(json.dumps(results, indent=1))
        return
    for bench, rows in results.items():
        print(f"{bench:24} {'seconds':>10} {'of simulation':>14} {'x real time':>12}")
        for name, row in rows.items():
            print(f"  {name:22} {row['seconds']:10.4f} {row['of_the_simulation']:14.4f} {row['times_real_time']:12.0f}")


if __name__ == "__main__":
    main()
