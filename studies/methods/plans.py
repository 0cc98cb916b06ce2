"""The methods of the race: each makes a plan for a rig from what ``rig tune`` has found there, with one knob."""

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from rig.arming.run_options import RunOptions
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import load_plan, plan_from
from rig.tuning import TuningRequest, tune
from studies.methods.rigs import CONTROLLED, SHIPPED, bench_of, levels_of, truth_at

Table = dict[str, Any]


@dataclass(frozen=True)
class Method:
    """A way to measure a backbone."""

    words: str
    """Name in tables and figures."""
    table: Callable[[str, bool, Table, float], Table]
    """Makes the plan: name of the rig, whether the force is pure, the plan of ``rig tune``, the knob."""
    knob: str
    """Name of the key that the knob is."""
    usual: float
    """Value of the knob that a person would begin with; see `usual_knob`."""
    pure: bool = True
    """Whether harmonics of the force can be controlled."""


@cache
def tuned(rig: str, condition: str) -> Table:
    """Return the plan that ``rig tune --harmonics 7`` writes under a condition, over the levels of the race."""
    levels = levels_of(rig, False)[1]
    request = TuningRequest(from_m=levels[0], to_m=levels[-1], harmonics=CONTROLLED)
    with TemporaryDirectory() as folder:
        found = tune(bench_of(rig, condition), Path(folder) / "tune.h5", request, RunOptions(seed=0))
    return tomllib.loads(found.plan_toml)


def plan_of(method: str, rig: str, pure: bool, condition: str, knob: float) -> Plan:
    """Return the plan of a method. A rig that drifts is tuned before it does."""
    known = tuned(rig, "1 x noise" if condition == "drift" else condition)
    table = METHODS[method].table(rig, pure, known, knob)
    if not pure:
        table["controller"] = {key: value for key, value in table["controller"].items() if key != "harmonics"}
    return plan_from({"bench": rig} | table, f"{method} on {rig}")


def _shipped(rig: str, kind: str) -> Table | None:
    if rig not in SHIPPED or (rig == "magnet-beam-symmetric" and kind != "backbone"):
        return None
    return load_plan(f"{rig}/{kind}").model_dump(mode="json", exclude_unset=True)


def _common(rig: str, kind: str, pure: bool, known: Table) -> Table:
    """Return the controller and plant: of the shipped plan of that kind where there is one, else as tuned."""
    shipped = _shipped(rig, kind) or known
    controller = dict(shipped["controller"])
    if pure:
        controller["harmonics"] = known["controller"]["harmonics"]
    out = {"controller": controller, "start_v": known["start_v"], "start_periods": known["start_periods"]}
    return out | {key: shipped[key] for key in ("plant", "start_v", "start_periods", "settle") if key in shipped}


def _paper(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """Settled points by voltage, with the paper's gains; on rigs of one's own those of its magnet beam."""
    plan = _shipped(rig, "backbone") or _shipped("magnet-beam", "backbone")
    controller = dict((plan or known)["controller"])
    if rig not in SHIPPED:
        window = known["controller"]["frequency_window_hz"]
        controller |= {"centre_frequency_hz": known["controller"]["centre_frequency_hz"], "frequency_window_hz": window}
    if pure:
        controller |= {"harmonics": known["controller"]["harmonics"], "period_mean": True}
    table = {
        "kind": "backbone",
        "levels_v": levels_of(rig, pure)[2],
        "record_periods": round(knob),
        "controller": controller,
    }
    settle = (plan or {}).get("settle") if rig in SHIPPED else None
    return table if settle is None else table | {"settle": settle}


def _exact(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """Settled points, everything as ``rig tune`` writes it except levels and length of the record."""
    return known | {"bench": rig, "levels_m": levels_of(rig, pure)[1], "record_periods": round(knob)}


def _short(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """Short points, evaluated with their ramps; a third of the knob is ramp."""
    table = _common(rig, "backbone-short", pure, known)
    table.pop("settle", None)
    return table | {
        "kind": "backbone",
        "evaluation": "slow-flow",
        "levels_m": levels_of(rig, pure)[1],
        "ramp_periods": max(1.0, knob / 3.0),
        "record_periods": max(4, round(2.0 * knob / 3.0)),
        "accepted_phase_error_deg": 60,
    }


def _continuous(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """Once up and down; lock and end as in the shipped plan, else shares of a way."""
    table = _common(rig, "continuous-backbone", pure, known)
    table.pop("settle", None)
    shipped = _shipped(rig, "continuous-backbone")
    lengths = {"ramp_periods": 10, "lock_periods": max(10.0, 0.2 * knob), "end_periods": 0.1 * knob}
    if shipped is not None:
        lengths = {key: shipped[key] for key in lengths if key in shipped}
    levels = levels_of(rig, pure)[1]
    return table | {"kind": "continuous-backbone", "levels_m": levels, "sweep_periods": max(10.0, knob)} | lengths


def _response(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """A held response at four lags around resonance, the force surface of which is cut at resonance."""
    return _common(rig, "response-controlled", pure, known) | {
        "kind": "response-controlled",
        "levels_m": levels_of(rig, pure)[1],
        "phase_lags_deg": [-120.0, -100.0, -80.0, -60.0],
        "record_periods": round(knob),
    }


def _stepped(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """A held force at a lag of -90 deg."""
    return _common(rig, "stepped-phase-fast", pure, known) | {
        "kind": "stepped-phase",
        "levels_n": levels_of(rig, pure)[0],
        "phase_lags_deg": [-90.0],
        "start_periods": 10,
        "record_periods": round(knob),
    }


def _sweep(rig: str, pure: bool, known: Table, knob: float) -> Table:
    """A sweep at every held force over 1 % more than the backbone's frequencies, in the direction in which these shift.

    The knob is the number of periods in which the frequency moves by half a bandwidth of the linear mode.
    """
    law, plant, shipped = known["controller"], known["plant"], _shipped(rig, "controlled-sweep-up")
    keys = ("low_pass_rad_s", "force_loop", "reference_integral_per_s", "response_integral_per_s", "plant_pole_rad_s")
    tuned_law = {"detector": "adaptive", "harmonics_followed": 5} | {key: law[key] for key in keys}
    linear, highest = frequencies_of(rig)
    way = 1.0 if highest > linear else -1.0
    hertz = plant["frequency_rad_s"] / (2.0 * math.pi)
    return {
        "kind": "sweep",
        "levels_n": levels_of(rig, pure)[0],
        "start_v": known["start_v"],
        "start_periods": 10,
        "start_hz": (1.0 - 0.01 * way) * linear,
        "stop_hz": (1.0 + 0.01 * way) * highest,
        "rate_hz_per_s": plant["damping_ratio"] * hertz**2 / knob,
        "controller": tuned_law if shipped is None else shipped["controller"],
    }


@cache
def frequencies_of(rig: str) -> tuple[float, float]:
    """Return the frequency at the lowest and at the highest level of the backbone, Hz."""
    found = truth_at(rig, False, np.array(levels_of(rig, False)[1]))[0]
    return float(found[0]), float(found[-1])


def usual_knob(method: str, rig: str) -> float:
    """Return the knob that a person would begin with: that of the shipped plan where a rig has one."""
    quick = rig in ("magnet-beam", "magnet-beam-symmetric")
    if method == "continuous":
        shipped = _shipped(rig, "continuous-backbone")
        return float(shipped["sweep_periods"]) if shipped else METHODS[method].usual * (1.0 if quick else 2.0)
    return METHODS[method].usual * (2.0 if method == "short" and not quick else 1.0)


METHODS: dict[str, Method] = {
    "settled": Method("settled, paper's gains", _paper, "record_periods", 50),
    "exact": Method("settled, exact laws", _exact, "record_periods", 50),
    "short": Method("short points", _short, "ramp and record periods", 15),
    "continuous": Method("continuous", _continuous, "sweep_periods", 50),
    "response": Method("response-controlled, cut", _response, "record_periods", 20),
    "stepped-phase": Method("stepped phase at -90 deg", _stepped, "record_periods", 20),
    "sweep": Method("controlled sweep", _sweep, "periods per half bandwidth", 60, pure=False),
}
