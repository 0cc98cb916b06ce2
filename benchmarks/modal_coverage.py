"""Do the 95 % intervals of linear modes hold the truth? Modal plans of virtual rigs, run after run, by `rig identify`.

    python -m benchmarks.modal_coverage [PLAN ...] [--runs 40] [--output FILE]

``own/modal`` is a plan on the rig of docs/tutorials/a-rig-of-your-own.md, ``open/modal`` on the same rig without its anti-alias
filter. Truth is the modes that the virtual rig is made of, with joints stuck. Each run has noise and phases of its own: with
the same phases, distortion and rounding are the same in every run, so that all runs together are one draw of them.
"""

import json
import re
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import rig
from benchmarks.coverage_rigs import tutorial
from benchmarks.frame import show
from identification import LinearModes
from rig.campaigns.plans import bench_of, load_plan
from rig.drivers import make_daq
from rig.results.linear_modes.identify import identify
from rig.results.linear_modes.options import LinearOptions
from simulators.analysis import LinearModes as TrueModes

PLANS = ("magnet-beam/modal", "friction-beam/modal", "own/modal", "open/modal")
QUANTITIES = ("frequency", "damping", "shape")
OWN_PLAN = """
kind = "multisine"
bench = "{bench}"
lowest_hz = 10.0
highest_hz = 500.0
resolution_hz = 0.05
realisations = 5
transient_periods = 1
periods = 2
levels_rms_v = [0.02, 0.04]
"""


def plan_of(name: str, folder: Path) -> str:
    """Return the name of a shipped plan, or the path of one made in ``folder``."""
    rig_name = name.partition("/")[0]
    if rig_name not in ("own", "open"):
        return name
    bench = tutorial(folder).with_name("end-stop.toml")
    text = re.sub(r"frequency_hz = \[.*?\]", "frequency_hz = [5.0, 1000.0]", bench.read_text(encoding="utf-8"))
    if rig_name == "open":
        text = re.sub(r"anti_alias_hz = .*", "anti_alias_hz = 0.0", text)
    bench.write_text(text, encoding="utf-8")
    plan = folder / "modal.toml"
    plan.write_text(OWN_PLAN.format(bench=bench), encoding="utf-8")
    return str(plan)


def outcomes(modes: LinearModes, truth: TrueModes) -> dict[float, dict[str, tuple[float, float]]]:
    """Return error and standard error, relative to the truth, by true frequency (Hz) and quantity."""
    found = {}
    for mode in range(modes.frequency_hz.size):
        true = truth.nearest(float(modes.frequency_hz[mode]))
        values = {
            "frequency": (modes.frequency_hz[mode], modes.frequency_std_hz[mode], truth.frequency_hz[true]),
            "damping": (modes.damping_ratio[mode], modes.damping_ratio_std[mode], truth.damping_ratio[true]),
            "shape": (modes.drive_shape[mode], modes.shapes_std[modes.drive_row, mode], truth.drive_shape[true]),
        }
        found[float(truth.frequency_hz[true])] = {
            name: (float(value / right - 1.0), float(std / right)) for name, (value, std, right) in values.items()
        }
    return found


def study(name: str, runs: int) -> dict[str, Any]:
    """Run a plan with as many seeds and return coverage, half-width and error, %, by mode and quantity."""
    everything: dict[float, list[dict[str, tuple[float, float]]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = plan_of(name, Path(folder))
        plan = load_plan(path)
        bench = bench_of(plan, path)
        truth = make_daq(bench).rig.linear_modes
        for seed in range(runs):
            out = Path(folder) / f"{seed}.h5"
            own = type(plan).model_validate(plan.model_dump(mode="json") | {"phase_seed": seed})
            with rig.run(own, bench=bench, seed=seed, output=out):
                pass
            for hz, outcome in outcomes(identify([out], LinearOptions()).modes, truth).items():
                everything.setdefault(hz, []).append(outcome)
            out.unlink()
    return {
        f"{hz:.1f} Hz": {name: _summary([one[name] for one in some]) for name in QUANTITIES}
        for hz, some in sorted(everything.items())
    }


def _summary(pairs: list[tuple[float, float]]) -> dict[str, float]:
    error, std = np.array(pairs).T
    half = 1.96 * std
    return {
        "outcomes": error.size,
        "covered": float(np.mean(np.abs(error) <= half)),
        "bias_in_standard_errors": float(np.mean(error / std)),
        "half_width_percent": 100.0 * float(np.median(half)),
        "half_width_over_error": float(np.median(half) / np.median(np.abs(error))),
    }


def main(
    plans: Annotated[list[str] | None, typer.Argument()] = None, runs: int = 40, output: Path | None = None
) -> None:
    """Run plans: those above or files. Print what their intervals come to; write all numbers."""
    everything: dict[str, Any] = {}
    for name in plans or PLANS:
        everything[name] = study(name, runs)
        show({name: everything[name]})
        if output is not None:
            output.write_text(json.dumps(everything, indent=1), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
