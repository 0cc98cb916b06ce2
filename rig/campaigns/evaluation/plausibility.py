"""Whether the channels of a point fit each other: by the mode shapes of the bench, and by the points before.

A sensor that fails in a plausible way trips nothing: one that reads noise only, one whose sensitivity has fallen to a tenth.
At phase resonance of one mode the fundamental of response k over that of the drive is ``phi_k / phi_d``, a real number; higher
harmonics and other modes change it by some per cent. What it differs by is a factor

    (max(|q|, |phi|) + a) / (min(|q|, |phi|) + a),    q = Y_k / Y_d phi_d

with an allowance ``a``, so that a channel near a node is not judged by the ratio of two small numbers. The allowance grows away
from resonance, with 1 over the cosine of the phase or with the detuning, whichever grows less.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.channel_misfit import Misfit, Seen, told
from rig.campaigns.evaluation.channel_ratios import (
    motions_of,
    ratios_of,
    resistance_of,
    rms_ratios_of,
    shapes_of,
    softened,
    spread_of,
)
from rig.campaigns.evaluation.lost_samples import rms_of
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan

__all__ = ["REFUSED", "WARNED", "with_plausibility", "with_plausible_ways"]

WARNED = 2.0  # a nonlinear mode's shape changes by some per cent, its damping with the root of the level
REFUSED = 4.0
ALLOWANCE = 0.1  # of the largest mode shape: other modes, cross-talk, a sensor some millimetres off its place
SURE = 3.0  # standard errors
FASTEST = 2.0  # change of a damping that is put down to the level
NEAR = 0.1  # in frequency, relative: in open loop only points so near are compared
FEW = 5  # of them
MANY = 100  # under a lock: more would tell no more

Point = Mapping[str, Any]


def with_plausibility(bench: Bench, plan: Plan, point: dict[str, Any], before: Sequence[Point]) -> dict[str, Any]:
    """The point with its ``misfit``, the largest factor; warned of or refused where that is too large.

    ``before``: the points before. Those that did not fit or were not accepted are no measure of others: a fault would become
    the usual. With a point that did not fit, others that are like it do not fit either.
    """
    return _judged(bench, point, misfits_of(bench, plan, point, before))


def with_plausible_ways(bench: Bench, point: dict[str, Any], pieces: Sequence[np.ndarray]) -> dict[str, Any]:
    """The same by the rows of two ways past one level, of which a point holds the mean; nothing is said of a single way."""
    if len(pieces) < 2:
        return point
    drive = bench.index_of("drive")
    up, down = (rms_ratios_of({"channel_rms": rms_of(rows)}, drive) for rows in pieces)
    responses = [index for index, channel in enumerate(bench.channels) if channel.role == "response"]
    allowed = ALLOWANCE * float(np.max(up[motions_of(bench)]))
    misfits = [
        _misfit(bench.channels[index].name, complex(down[index]), complex(up[index]), allowed, Seen.OTHER_WAY)
        for index in responses
    ]
    return _judged(bench, point, misfits)


def _judged(bench: Bench, point: dict[str, Any], misfits: Sequence[Misfit]) -> dict[str, Any]:
    if not misfits:
        return point
    worst = max(misfit.factor for misfit in misfits)
    point = {**point, "misfit": max(worst, point.get("misfit", 1.0))}
    if worst < WARNED:
        return point
    point["misfit_channels"] = sorted({misfit.channel for misfit in misfits if misfit.factor >= WARNED})
    text = told(misfits, bench.channels[bench.index_of("drive")].name, WARNED, REFUSED)
    if worst < REFUSED or not point["accepted"]:
        return {**point, "warnings": [*(point.get("warnings") or ()), text]}
    return {**point, "accepted": False, "quality": "implausible", "reason": text}


def misfits_of(bench: Bench, plan: Plan, point: Point, before: Sequence[Point]) -> list[Misfit]:
    """By how much each channel differs from what is expected of it; none where nothing is known to compare with."""
    usual = [one for one in before if one["accepted"] and one.get("misfit", 1.0) < WARNED]
    if "harmonics" in point:
        tones = [one for one in usual if "harmonics" in one]
        force = _of_the_force(bench, point, tones, before) if isinstance(plan, LockedPlan) else []
        return [*_of_a_tone(bench, plan, point, tones), *force]
    if "channel_rms" in point:
        return _of_a_band(bench, point, [one for one in usual if "channel_rms" in one])
    return []


def _of_a_tone(bench: Bench, plan: Plan, point: Point, before: Sequence[Point]) -> list[Misfit]:
    """Fundamentals of the responses over that of the drive."""
    drive, locked = bench.index_of("drive"), isinstance(plan, LockedPlan)
    ratios, spread = ratios_of(point, drive), spread_of(bench, point, drive)
    times = 1.0 if spread is None else softened(bench, point, drive)
    if not locked:
        off = [abs(math.log(one["frequency_hz"] / point["frequency_hz"])) for one in before]
        before = [before[i] for i in np.argsort(off, kind="stable")[:FEW] if off[i] < NEAR]
    usual = np.median([ratios_of(one, drive) for one in before[-MANY:]], axis=0) if before else None
    shapes = shapes_of(bench) if locked or _near_the_mode(bench, point) else None
    out = []
    for index, channel in enumerate(bench.channels):
        if channel.role != "response" or spread is None:
            continue
        for expected, by in ((shapes, Seen.SHAPES), (usual, Seen.BEFORE)):
            if expected is not None and np.isfinite(expected[index]):
                largest = float(np.nanmax(np.abs([expected[i] for i in motions_of(bench)])))
                allowed = ALLOWANCE * times * largest + SURE * spread[index]
                out.append(_misfit(channel.name, complex(ratios[index]), complex(expected[index]), allowed, by))
    return out


def _of_the_force(bench: Bench, point: Point, usual: Sequence[Point], before: Sequence[Point]) -> list[Misfit]:
    """In-phase force over velocity, against the nearest of the points before: a damping may change with the level's root.

    Over some levels a damping may change so much that a fault is hidden. So a point that is like a nearer one of which the
    force did not fit does not fit either.
    """
    force = bench.channels[bench.index_of("force")].name
    nearest, misfitting = (
        min(
            (one for one in some if one["level_unit"] == point["level_unit"]),
            key=lambda one: (_apart(point, one, "level"), _lags_apart(point, one)),
            default=None,
        )
        for some in (usual, [one for one in before if force in one.get("misfit_channels", ())])
    )
    if nearest is None:
        return []
    times, factor = _against(bench, point, nearest)
    found = Misfit(force, times, 1.0, factor, Seen.BEFORE, _level_of(nearest))
    if misfitting is not None and _apart(point, misfitting, "level") < _apart(point, nearest, "level"):
        times, factor = _against(bench, point, misfitting)
        if factor < WARNED <= misfitting["misfit"] and found.factor < misfitting["misfit"]:
            return [Misfit(force, times, 1.0, misfitting["misfit"], Seen.NOT_TRUSTED, _level_of(misfitting))]
    return [found]


def _against(bench: Bench, point: Point, other: Point) -> tuple[float, float]:
    """Force over velocity over that of another point, and by how much that is more than the levels tell of."""
    here, there = resistance_of(bench, point), resistance_of(bench, other)
    if not (here > 0.0 and there > 0.0):
        return 1.0, 1.0
    allowed = min(math.exp(0.5 * _apart(point, other, "level")), FASTEST)
    return here / there, max(here / there / allowed, there / here / allowed, 1.0)


def _level_of(point: Point) -> str:
    return f"{point['level']:.4g} {point['level_unit']}"


def _of_a_band(bench: Bench, point: Point, before: Sequence[Point]) -> list[Misfit]:
    """RMS of force and responses over that of the drive, against the points before at the same level."""
    alike = [one for one in before if one["level"] == point["level"]]
    drive = bench.index_of("drive")
    here, usual = (
        rms_ratios_of(point, drive),
        np.median([rms_ratios_of(one, drive) for one in alike], axis=0) if alike else None,
    )
    if usual is None:
        return []
    return [
        _misfit(channel.name, complex(here[index]), complex(usual[index]), 1e-12, Seen.BEFORE)
        for index, channel in enumerate(bench.channels)
        if channel.role in ("force", "response") and usual[index] > 0.0
    ]


def _misfit(name: str, seen: complex, expected: complex, allowed: float, by: Seen) -> Misfit:
    """How far a ratio is from the expected one; opposite signs of what stands out are as far apart as can be."""
    size, wanted = abs(seen), abs(expected)
    factor = (max(size, wanted) + allowed) / (min(size, wanted) + allowed)
    turned = (seen * expected.conjugate()).real < 0.0
    if turned and min(size, wanted) > 2.0 * allowed:
        return Misfit(name, -size, wanted, float(max(factor, REFUSED)), by)
    return Misfit(name, size, wanted, float(factor), by)


def _near_the_mode(bench: Bench, point: Point) -> bool:
    return abs(math.log(point["frequency_hz"] / bench.specimen.linear_frequency_hz)) < NEAR


def _apart(one: Point, other: Point, key: str) -> float:
    return abs(math.log(float(one[key]) / float(other[key])))


def _lags_apart(one: Point, other: Point) -> float:
    return abs(float(one.get("asked_phase_lag_deg", 0.0)) - float(other.get("asked_phase_lag_deg", 0.0)))
