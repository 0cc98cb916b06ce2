"""Plans for `benchmarks.coverage` on rigs that are not shipped, by ``RIG/KIND``: ``own/response-controlled``.

``own`` is the rig of docs/tutorials/a-rig-of-your-own.md, ``drawn`` one of `benchmarks.random_rigs`. `rig tune` tunes them
once; levels and gains of all plans are those of its plan. The mode shape at the drive point is the true one, so that its error,
one for all seeds, is not in the result.
"""

import re
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from benchmarks.random_rigs import drawn
from rig.arming.run_options import RunOptions
from rig.bench import load_bench
from rig.drivers import make_daq
from rig.tuning import tune

KINDS = ("backbone", "backbone-short", "response-controlled", "continuous-backbone")
OWN, DRAWN = "own", "drawn"
SEED = 504
"""Of the drawn rig."""
TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorials" / "a-rig-of-your-own.md"
LAGS_DEG = [-153.0, -130.0, -110.0, -90.0, -70.0, -50.0, -27.0]
_TUNED = ("low_pass_rad_s", "frequency_integral_per_s", "response_integral_per_s", "plant_pole_rad_s")
_WINDOW = ("centre_frequency_hz", "frequency_window_hz")


def tutorial(folder: Path) -> Path:
    """Write bench and plan of the tutorial into a folder, and return the path of the plan."""
    blocks = re.findall(r"```toml\n# file: (\S+)\n(.*?)```", TUTORIAL.read_text(encoding="utf-8"), flags=re.DOTALL)
    for name, text in blocks:
        (folder / name).write_text(text, encoding="utf-8")
    return folder / next(name for name, _ in blocks if name.endswith("-plan.toml"))


def plan_of(name: str, folder: Path) -> str:
    """Return what `rig.campaigns.plans.load_plan` takes: the name of a shipped plan, or the path of one made in ``folder``."""
    rig_name, _, kind = name.partition("/")
    if rig_name == OWN and not kind:
        return str(tutorial(folder))
    if rig_name not in (OWN, DRAWN):
        return name
    if kind not in KINDS:
        raise ValueError(f"{name}: no kind '{kind}', allowed is one of {', '.join(KINDS)}")
    if rig_name == OWN:
        bench = tutorial(folder).with_name("end-stop.toml")
    else:
        bench = folder / "drawn.toml"
        bench.write_text(tomli_w.dumps(drawn(SEED)), encoding="utf-8")
    plan = folder / f"{kind}.toml"
    plan.write_text(tomli_w.dumps(_plan(kind, bench, _tuned(bench))), encoding="utf-8")
    return str(plan)


def _tuned(bench: Path) -> dict[str, Any]:
    """Return the plan that `rig tune` writes, with the true mode shape at the drive point."""
    out = tune(bench, bench.with_suffix(".h5"), options=RunOptions(seed=SEED, overwrite=True))
    plan = tomllib.loads(out.plan_toml)
    modes = make_daq(load_bench(bench)).rig.linear_modes
    hertz = plan["plant"]["frequency_rad_s"] / 6.283185307179586
    mode = min(range(len(modes.frequency_hz)), key=lambda one: abs(modes.frequency_hz[one] - hertz))
    plan["plant"]["drive_shape"] = abs(float(modes.drive_shape[mode]))
    plan["plant"].pop("drive_shape_std", None)
    return plan


def _plan(kind: str, bench: Path, tuned: dict[str, Any]) -> dict[str, Any]:
    """Return a plan of a kind with the levels and gains of the tuned one."""
    if kind == "backbone":
        return tuned | {"bench": str(bench)}
    controller = {key: tuned["controller"][key] for key in (*_TUNED, *_WINDOW)}
    controller |= {"detector": "adaptive", "frequency_law": "frequency-error", "harmonics_followed": 5}
    start = {key: tuned[key] for key in ("start_v", "start_periods")}
    table = {
        "bench": str(bench),
        "levels_m": tuned["levels_m"],
        "controller": controller,
        "plant": tuned["plant"],
    } | start
    if kind == "backbone-short":
        extra = {"kind": "backbone", "evaluation": "slow-flow", "ramp_periods": 10, "record_periods": 20}
        return table | extra | {"accepted_phase_error_deg": 45}
    if kind == "continuous-backbone":
        return table | {"kind": kind, "sweep_periods": 150, "end_periods": 10}
    return table | {"kind": kind, "phase_lags_deg": LAGS_DEG, "settle": tuned["settle"] | {"settled_periods": 10}}
