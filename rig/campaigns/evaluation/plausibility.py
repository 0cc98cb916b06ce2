"""Whether the channels of a point fit each other: by the mode shapes of the bench, and by the points before.

A sensor may fail in a way that trips no limit: it reads noise only, or its sensitivity falls to a tenth.
At phase resonance of one mode the fundamental of response k over that of the drive is ``phi_k / phi_d``, a real number; higher
harmonics and other modes change it by some per cent. What it differs by is a factor

    (max(|q|, |phi|) + a) / (min(|q|, |phi|) + a),    q = Y_k / Y_d phi_d

with an allowance ``a``, so that a channel near a node is not judged by the ratio of two small numbers. The allowance grows away
from resonance, with 1 over the cosine of the phase or with the detuning, whichever grows less.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.channel_misfit import Misfit, Seen, misfit_sentence
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
from rig.campaigns.evaluation.point import Point, Quality, vibration_of
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


def with_plausibility(bench: Bench, plan: Plan, point: Point[Any], before: Sequence[Point[Any]]) -> Point[Any]:
    """The point with its ``misfit``, the largest factor; with a warning or refused where that is too large.

    ``before``: the points before. Those that did not fit or were not accepted are not compared with: a fault would become
    the usual. A point that is like one that did not fit does not fit either.
    """
    return _judged(bench, point, misfits_of(bench, plan, point, before))


def with_plausible_ways(bench: Bench, point: Point[Any], pieces: Sequence[np.ndarray]) -> Point[Any]:
    """The same from the rows of two ways past one level, of which a point holds the mean; a single way is not judged."""
    if len(pieces) < 2:
        return point
    drive = bench.index_of("drive")
    up, down = (rms_ratios_of(rms_of(rows), drive) for rows in pieces)
    responses = [index for index, channel in enumerate(bench.channels) if channel.role == "response"]
    allowed = ALLOWANCE * float(np.max(up[motions_of(bench)]))
    misfits = [
        _misfit(bench.channels[index].name, complex(down[index]), complex(up[index]), allowed, Seen.OTHER_WAY)
        for index in responses
    ]
    return _judged(bench, point, misfits)


def _judged(bench: Bench, point: Point[Any], misfits: Sequence[Misfit]) -> Point[Any]:
    if not misfits:
        return point
    worst = max(misfit.factor for misfit in misfits)
    point = replace(point, misfit=max(worst, _misfit_of(point)))
    if worst < WARNED:
        return point
    names = {misfit.channel for misfit in misfits if misfit.factor >= WARNED}
    point = replace(point, misfit_channels=tuple(sorted(names)))
    text = misfit_sentence(misfits, bench.channels[bench.index_of("drive")].name, WARNED, REFUSED)
    if worst < REFUSED or not point.accepted:
        return point.warned(text)
    return point.refused(text, Quality.IMPLAUSIBLE)


def _misfit_of(point: Point[Any]) -> float:
    """Its misfit; 1 where there was nothing to compare with."""
    return 1.0 if point.misfit is None else point.misfit


def misfits_of(bench: Bench, plan: Plan, point: Point[Any], before: Sequence[Point[Any]]) -> list[Misfit]:
    """By how much each channel differs from what is expected of it; none where nothing is known to compare with."""
    usual = [one for one in before if one.accepted and _misfit_of(one) < WARNED]
    if point.spectrum is not None:
        tones = [one for one in usual if one.spectrum is not None]
        force = _of_the_force(bench, point, tones, before) if isinstance(plan, LockedPlan) else []
        return [*_of_a_tone(bench, plan, point, tones), *force]
    return _of_a_band(bench, point, usual)


def _of_a_tone(bench: Bench, plan: Plan, point: Point[Any], before: Sequence[Point[Any]]) -> list[Misfit]:
    """Fundamentals of the responses over that of the drive."""
    drive, locked = bench.index_of("drive"), isinstance(plan, LockedPlan)
    ratios, spread = ratios_of(point, drive), spread_of(bench, point, drive)
    times = 1.0 if spread is None else softened(bench, point, drive)
    if not locked:
        frequency_hz = vibration_of(point).frequency_hz
        off = [abs(math.log(vibration_of(one).frequency_hz / frequency_hz)) for one in before]
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


def _of_the_force(
    bench: Bench, point: Point[Any], usual: Sequence[Point[Any]], before: Sequence[Point[Any]]
) -> list[Misfit]:
    """In-phase force over velocity, against the nearest of the points before: a damping may change with the level's root.

    Over some levels a damping may change so much that a fault is hidden. So a point that is like a nearer one of which the
    force did not fit does not fit either.
    """
    force = bench.channels[bench.index_of("force")].name
    nearest, misfitting = (
        min(
            (one for one in some if one.level_unit == point.level_unit),
            key=lambda one: (_apart(point, one), _lags_apart(point, one)),
            default=None,
        )
        for some in (usual, [one for one in before if force in one.misfit_channels])
    )
    if nearest is None:
        return []
    times, factor = _against(bench, point, nearest)
    found = Misfit(force, times, 1.0, factor, Seen.BEFORE, _level_of(nearest))
    if misfitting is not None and _apart(point, misfitting) < _apart(point, nearest):
        times, factor = _against(bench, point, misfitting)
        theirs = _misfit_of(misfitting)
        if factor < WARNED <= theirs and found.factor < theirs:
            return [Misfit(force, times, 1.0, theirs, Seen.NOT_TRUSTED, _level_of(misfitting))]
    return [found]


def _against(bench: Bench, point: Point[Any], other: Point[Any]) -> tuple[float, float]:
    """Force over velocity over that of another point, and by how much that is more than the levels tell of."""
    here, there = resistance_of(bench, point), resistance_of(bench, other)
    if not (here > 0.0 and there > 0.0):
        return 1.0, 1.0
    allowed = min(math.exp(0.5 * _apart(point, other)), FASTEST)
    return here / there, max(here / there / allowed, there / here / allowed, 1.0)


def _level_of(point: Point[Any]) -> str:
    return f"{point.level:.4g} {point.level_unit}"


def _of_a_band(bench: Bench, point: Point[Any], before: Sequence[Point[Any]]) -> list[Misfit]:
    """RMS of force and responses over that of the drive, against the points before at the same level."""
    alike = [one.channel_rms for one in before if one.channel_rms is not None and one.level == point.level]
    if point.channel_rms is None or not alike:
        return []
    drive = bench.index_of("drive")
    here = rms_ratios_of(point.channel_rms, drive)
    usual = np.median([rms_ratios_of(sizes, drive) for sizes in alike], axis=0)
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


def _near_the_mode(bench: Bench, point: Point[Any]) -> bool:
    return abs(math.log(vibration_of(point).frequency_hz / bench.specimen.linear_frequency_hz)) < NEAR


def _apart(one: Point[Any], other: Point[Any]) -> float:
    """Between the levels of two points, as a logarithm."""
    return abs(math.log(one.level / other.level))


def _lags_apart(one: Point[Any], other: Point[Any]) -> float:
    """Between the lags that were asked for, deg."""
    return abs((one.asked_phase_lag_deg or 0.0) - (other.asked_phase_lag_deg or 0.0))
