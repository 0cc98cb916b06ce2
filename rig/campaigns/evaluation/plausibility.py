"""Check whether the channels of a point fit each other, by the mode shapes of plan and bench and by earlier points.

A sensor may fail in a way that trips no limit: it reads only noise, or its sensitivity falls to a tenth. At phase resonance of
one mode, the fundamental of response k over that of the drive is the real number ``phi_k / phi_d``; higher harmonics and other
modes change it by some per cent. The deviation is expressed as a factor

    (max(|q|, |phi|) + a) / (min(|q|, |phi|) + a),    q = Y_k / Y_d phi_d

with an allowance ``a``, so that a channel near a node is not judged by the ratio of two small numbers. The allowance grows away
from resonance, with 1 over the cosine of the phase or with the detuning, whichever grows less.

The phase of ``q`` shows what the size does not: a drive sensor whose conditioner delays it turns all responses against it, and
the loop then holds another phase than that of resonance. It is compared with that of the shape (0 or 180 degrees) or of earlier
points. The turn beyond three standard errors, over the same growth away from resonance, is warned of from `WARNED_DEG` and
refused from `REFUSED_DEG` on. A delay common to all motions cannot be seen in this way.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.channel_misfit import (
    CHANGED,
    REFUSED,
    REFUSED_DEG,
    WARNED,
    WARNED_DEG,
    Misfit,
    Reference,
    misfit_sentence,
)
from rig.campaigns.evaluation.channel_ratios import (
    allowance_growth,
    motions_of,
    over_drive,
    ratio_std,
    ratios_of,
    resistance_of,
    shapes_of,
)
from rig.campaigns.evaluation.lost_samples import rms_of
from rig.campaigns.evaluation.point import Point, Quality, vibration_of
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.text.levels import level_text

REVERSED_DEG = 135.0  # from here on a turn counts as a wrong sign; halfway between 90 and 180
SWAPPED = 0.1  # deviation of sizes, as a logarithm, from which it is asked whether two channels are swapped
SWAPPED_FITS = 0.3  # of that deviation; two channels are called swapped if exchanging them leaves less
ALLOWANCE = 0.1  # of the largest mode shape: other modes, cross-talk, a sensor some millimetres out of place
SURE = 3.0  # standard errors
FASTEST = 2.0  # largest change of a damping that is attributed to the level
NEAR = 0.1  # relative frequency distance: in open loop only points this close are compared
FEW = 5  # largest number of such points
MANY = 100  # largest number of points compared under a lock: more would add nothing


def with_plausibility(bench: Bench, plan: Plan, point: Point[object], before: Sequence[Point[object]]) -> Point[object]:
    """Return the point with ``misfit``, its largest factor, and with a warning or a refusal if the factor is too large.

    ``before`` are the earlier points. Points that did not fit or were not accepted are not used as a reference; otherwise a
    fault would become the expectation. A point that agrees with a point that did not fit does not fit either.
    """
    return _judged(bench, point, misfits_of(bench, plan, point, before))


def with_plausible_ways(bench: Bench, point: Point[object], pieces: Sequence[np.ndarray]) -> Point[object]:
    """Check a point that is the mean of two ways by comparing the rows of both ways. A single way is not judged."""
    if len(pieces) < 2:
        return point
    drive = bench.index_of("drive")
    up, down = (over_drive(rms_of(rows), drive) for rows in pieces)
    responses = [index for index, channel in enumerate(bench.channels) if channel.role == "response"]
    allowed = ALLOWANCE * float(np.max(up[motions_of(bench)]))
    misfits = [
        _misfit(bench.channels[index].name, complex(down[index]), complex(up[index]), allowed, Reference.OTHER_WAY)
        for index in responses
    ]
    return _judged(bench, point, misfits)


def start_refusal(bench: Bench, plan: Plan, point: Point[object]) -> str:
    """Return why the vibration at the start voltage does not fit the mode shapes; an empty string unless it is refused."""
    misfits = _of_a_tone(bench, plan, point, ())
    if not any(misfit.refused for misfit in misfits):
        return ""
    return misfit_sentence(misfits, bench.channels[bench.index_of("drive")].name)


def _judged(bench: Bench, point: Point[object], misfits: Sequence[Misfit]) -> Point[object]:
    if not misfits:
        return point
    point = replace(point, misfit=max(*(misfit.factor for misfit in misfits), _misfit_of(point)))
    names = {misfit.channel for misfit in misfits if misfit.warned}
    if not names:
        return point
    point = replace(point, misfit_channels=tuple(sorted(names)))
    text = misfit_sentence(misfits, bench.channels[bench.index_of("drive")].name)
    if not any(misfit.refused for misfit in misfits) or not point.accepted:
        return point.warned(text)
    return point.refused(text, Quality.IMPLAUSIBLE)


def _misfit_of(point: Point[object]) -> float:
    """Return the misfit of a point; 1 if there was nothing to compare with."""
    return 1.0 if point.misfit is None else point.misfit


def misfits_of(bench: Bench, plan: Plan, point: Point[object], before: Sequence[Point[object]]) -> list[Misfit]:
    """Return the misfit of each channel from its expectation; an empty list if nothing is known to compare with."""
    usual = [one for one in before if one.accepted and not one.misfit_channels]
    if point.spectrum is not None:
        tones = [one for one in usual if one.spectrum is not None]
        force = _of_the_force(bench, point, tones, before) if isinstance(plan, LockedPlan) else []
        return [*_of_a_tone(bench, plan, point, tones), *force]
    return _of_a_band(bench, point, usual)


def _of_a_tone(bench: Bench, plan: Plan, point: Point[object], before: Sequence[Point[object]]) -> list[Misfit]:
    """Compare the fundamentals of the responses, relative to the drive, with the mode shapes and with earlier points."""
    drive, locked = bench.index_of("drive"), isinstance(plan, LockedPlan)
    ratios, spread = ratios_of(point, drive), ratio_std(bench, point, drive)
    times = 1.0 if spread is None else allowance_growth(bench, point, drive)
    if not locked:
        frequency_hz = vibration_of(point).frequency_hz
        off = [abs(math.log(vibration_of(one).frequency_hz / frequency_hz)) for one in before]
        before = [before[i] for i in np.argsort(off, kind="stable")[:FEW] if off[i] < NEAR]
    usual = np.median([ratios_of(one, drive) for one in before[-MANY:]], axis=0) if before else None
    near = abs(math.log(vibration_of(point).frequency_hz / bench.specimen.linear_frequency_hz)) < NEAR
    shapes = shapes_of(bench, plan) if locked or near else None
    out = []
    for index, channel in enumerate(bench.channels):
        if channel.role != "response" or spread is None:
            continue
        for expected, by in ((shapes, Reference.SHAPES), (usual, Reference.BEFORE)):
            if expected is not None and np.isfinite(expected[index]):
                largest = float(np.nanmax(np.abs([expected[i] for i in motions_of(bench)])))
                allowed = ALLOWANCE * times * largest + SURE * spread[index]
                seen, wanted = complex(ratios[index]), complex(expected[index])
                found = _misfit(channel.name, seen, wanted, allowed, by)
                out += [found, *_turned(channel.name, seen, wanted, allowed, by, float(spread[index]), times)]
    return out + (_swapped(bench, np.abs(ratios), np.abs(shapes)) if locked and shapes is not None else [])


def _of_the_force(
    bench: Bench, point: Point[object], usual: Sequence[Point[object]], before: Sequence[Point[object]]
) -> list[Misfit]:
    """Compare in-phase force over velocity with that of the nearest earlier point.

    Damping may change with the square root of the level. Over several levels it may change so much that it hides a fault.
    Therefore a point does not fit if it agrees with a nearer point whose force did not fit.
    """
    force, lag_deg = bench.channels[bench.index_of("force")].name, point.asked_phase_lag_deg or 0.0
    nearest, misfitting = (
        min(
            (one for one in some if one.level_unit == point.level_unit),
            key=lambda one: (_apart(point, one), abs(lag_deg - (one.asked_phase_lag_deg or 0.0))),
            default=None,
        )
        for some in (usual, [one for one in before if force in one.misfit_channels])
    )
    if nearest is None:
        return []
    times, factor = _against(bench, point, nearest)
    found = Misfit(force, times, 1.0, factor, Reference.BEFORE, _level_of(nearest))
    if misfitting is not None and _apart(point, misfitting) < _apart(point, nearest):
        times, factor = _against(bench, point, misfitting)
        theirs = _misfit_of(misfitting)
        if factor < CHANGED <= theirs and found.factor < theirs:
            return [Misfit(force, times, 1.0, theirs, Reference.NOT_TRUSTED, _level_of(misfitting))]
    return [found]


def _against(bench: Bench, point: Point[object], other: Point[object]) -> tuple[float, float]:
    """Return the ratio of force over velocity to that of another point, and the factor that the levels do not explain."""
    here, there = resistance_of(bench, point), resistance_of(bench, other)
    if not (here > 0.0 and there > 0.0):
        return 1.0, 1.0
    allowed = min(math.exp(0.5 * _apart(point, other)), FASTEST)
    return here / there, max(here / there / allowed, there / here / allowed, 1.0)


def _level_of(point: Point[object]) -> str:
    return level_text(point.level, point.level_unit)


def _of_a_band(bench: Bench, point: Point[object], before: Sequence[Point[object]]) -> list[Misfit]:
    """Compare the RMS of force and responses, relative to the drive, with earlier points at the same level."""
    alike = [one.channel_rms for one in before if one.channel_rms is not None and one.level == point.level]
    if point.channel_rms is None or not alike:
        return []
    drive = bench.index_of("drive")
    here = over_drive(point.channel_rms, drive)
    usual = np.median([over_drive(sizes, drive) for sizes in alike], axis=0)
    return [
        _misfit(channel.name, complex(here[index]), complex(usual[index]), 1e-12, Reference.BEFORE)
        for index, channel in enumerate(bench.channels)
        if channel.role in ("force", "response") and usual[index] > 0.0
    ]


def _misfit(name: str, seen: complex, expected: complex, allowed: float, by: Reference) -> Misfit:
    """Return the misfit between a ratio and its expectation. If both are significant, opposite signs are always refused."""
    size, wanted = abs(seen), abs(expected)
    factor = (max(size, wanted) + allowed) / (min(size, wanted) + allowed)
    turned = (seen * expected.conjugate()).real < 0.0
    if turned and min(size, wanted) > 2.0 * allowed:
        return Misfit(name, -size, wanted, float(max(factor, REFUSED)), by)
    return Misfit(name, size, wanted, float(factor), by)


def _turned(
    name: str, seen: complex, wanted: complex, allowed: float, by: Reference, spread: float, times: float
) -> list[Misfit]:
    """Return the misfit in phase between a ratio and its expectation; an empty list if either of them is too small to tell.

    The turn is expressed as a factor, so that both kinds of misfit are compared: `WARNED_DEG` is `WARNED`, `REFUSED_DEG` is
    `REFUSED`.
    """
    if min(abs(seen), abs(wanted)) <= 2.0 * allowed:
        return []
    turn_deg = math.degrees(cmath.phase(seen / wanted))
    if abs(turn_deg) > REVERSED_DEG:  # a matter of sign, which `_misfit` judges
        return []
    beyond = max(0.0, abs(turn_deg) - math.degrees(SURE * spread / abs(seen))) / times
    factor = WARNED * (beyond / WARNED_DEG) ** (math.log(REFUSED / WARNED) / math.log(REFUSED_DEG / WARNED_DEG))
    return [Misfit(name, abs(seen), abs(wanted), max(1.0, factor), by, turn_deg=turn_deg)]


def _swapped(bench: Bench, sizes: np.ndarray, shapes: np.ndarray) -> list[Misfit]:
    """Return a misfit that is warned of if the sizes fit the shapes much better with the cables of two channels exchanged."""
    volts = np.abs([channel.sensitivity_v_per_unit for channel in bench.channels])
    known = [
        i for i in motions_of(bench) if sizes[i] > 0.0 and shapes[i] > ALLOWANCE * np.nanmax(shapes[motions_of(bench)])
    ]

    def deviation(one: int, other: int) -> float:
        exchanged = sizes.copy()
        exchanged[one], exchanged[other] = (sizes[b] * volts[b] / volts[a] for a, b in ((one, other), (other, one)))
        off = np.log(exchanged[known] / shapes[known])
        return float(np.max(np.abs(off - off[known.index(bench.index_of("drive"))]), initial=0.0))

    if bench.index_of("drive") not in known:
        return []
    pairs = {(a, b): deviation(a, b) for a, b in combinations(known, 2)}
    one, other = min(pairs, key=lambda pair: pairs[pair], default=(0, 0))
    as_it_is = deviation(one, one)
    if one == other or as_it_is < SWAPPED or pairs[one, other] > SWAPPED_FITS * as_it_is:
        return []
    names = [bench.channels[index].name for index in (one, other)]
    return [Misfit(names[0], float(sizes[one]), float(shapes[one]), WARNED, Reference.SHAPES, swapped_with=names[1])]


def _apart(one: Point[object], other: Point[object]) -> float:
    return abs(math.log(one.level / other.level))
