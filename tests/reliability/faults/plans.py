"""Short plans of every kind of level; three levels or four, which without a fault are all accepted."""

from typing import Any

from rig.bench import Bench
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import load_plan, plan_from
from tests.rig.rigs import bench_with

BLOCK = 10
SHORT = {
    "kind": "backbone",
    "record_periods": 10,
    "ramp_periods": 10,
    "settle": {"average_periods": 5, "settled_periods": 5, "longest_periods": 200},
}


def _loops(plan: str, **changes: Any) -> dict[str, Any]:
    return {**load_plan(plan).model_dump(mode="json")["controller"], **changes}


def _quick(specimen: str, low_pass_rad_s: float, **changes: Any) -> dict[str, Any]:
    """The paper's gains behind an adaptive filter, which follows within a few periods."""
    filtered = {"detector": "adaptive", "low_pass_rad_s": low_pass_rad_s, "harmonics_followed": 5, "period_mean": False}
    return _loops(f"{specimen}/backbone", **filtered, **changes)


UNSLOWED = {"waiting_deg": 120.0}
"""A lock whose ramps the phase does not slow: after a slow ramp the short rule takes a force for settled that still falls."""
MAGNET, FRICTION = ("magnet-beam", 30.62), ("friction-beam", 187.2)
LEVELS: dict[str, dict[str, Any]] = {
    "V": {"bench": "magnet-beam", "levels_v": [0.6, 0.7, 0.8], "controller": _loops("magnet-beam/backbone")},
    "N logarithmic": {
        "bench": "magnet-beam",
        "levels_n": [0.15, 0.16, 0.17],
        "start_v": 0.92,
        "controller": _quick(*MAGNET, force_loop="logarithmic"),
    },
    "N linear": {
        "bench": "magnet-beam",
        "levels_n": [0.15, 0.16, 0.17],
        "start_v": 0.92,
        "controller": _quick(*MAGNET, force_loop="linear", k3=1.0, k4=10.0),
    },
    "m": {
        "bench": "magnet-beam",
        "levels_m": [5e-4, 5.5e-4, 6e-4],
        "start_v": 0.3,
        "controller": _loops("magnet-beam/response-controlled"),
    },
    "V, friction": {
        "bench": "friction-beam",
        "levels_v": [0.3, 0.35, 0.4],
        "controller": _quick(*FRICTION, lock=UNSLOWED),
    },
    "N, friction": {
        "bench": "friction-beam",
        "levels_n": [1.0, 1.05, 1.1, 1.15],  # long enough for a sensor to be stuck for half a second
        "start_v": 0.28,
        "controller": _quick(*FRICTION, force_loop="logarithmic", force_integral_per_s=5.0),
    },
}
"""By the unit of what is held, the loop that holds it, and the specimen where it is not the magnet beam."""


def plan_for(levels: str) -> Plan:
    """The short plan with these levels."""
    return plan_from({**SHORT, **LEVELS[levels]}, levels)


def bench_for(levels: str) -> Bench:
    """Its bench."""
    return bench_with({"block": BLOCK}, LEVELS[levels]["bench"])
