"""Likely cause of a trip, judged by what was measured before it, and advice on what to do."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.campaigns.running.tripped_level import TrippedAt
from rig.tick.safety.layout import POLARITY_HINT, EndReason

SHARE_TOO_HIGH = 0.7  # of a limit: a level expected to reach this share, in proportion to an earlier level, is too high
PROPOSED_SHARE = 0.9  # of a limit: share that the proposed level should reach, in proportion
NEAR_WINDOW_END = 0.01  # of a frequency window's width

LIMITS = {
    EndReason.FORCE_LIMIT: "force_n",
    EndReason.RESPONSE_LIMIT: "acceleration_m_s2",
    EndReason.DISPLACEMENT_LIMIT: "displacement_m",
    EndReason.OVERTRAVEL: "displacement_m",
}
"""The limit of the bench that a trip reason refers to."""

SAMPLES = 256  # of a period
BESIDE_THE_LEVEL = {
    EndReason.NON_FINITE_INPUT: ("the device delivered no number", "look at device and driver, then `rig check`"),
    EndReason.NON_FINITE_OUTPUT: (
        "the control law diverged",
        "look at the gains of the controller, or have them made by `rig tune`",
    ),
    EndReason.DRIVER_FAILED: ("device, wire or driver, not the level", "see that `rig doctor --daq BENCH` answers"),
    EndReason.SAMPLES_LOST: ("wire or computer were too slow, not the level", "see `rig doctor --daq BENCH`"),
    EndReason.PLANT_CONTRADICTED: (
        "amplifier or a sensor of force or drive has another gain or polarity than when [plant] was measured",
        "look at the amplifier's gain and at both sensors, then `rig check`; after a change of the rig, run `rig tune` again",
    ),
    EndReason.EMERGENCY_STOP: ("somebody pressed the stop, or its cable is broken", "ask who, and release it"),
    EndReason.SENSOR_STUCK: (
        "sensor, cable or supply of channel {channel} is dead, or the level is below one bit of its converter",
        "look at the channel, then `rig check`; raise the level if it is alive",
    ),
    EndReason.LEVEL_NOT_FOLLOWED: (
        "sensor or cable of channel {channel} has failed, or the amplifier does not put out what it is told",
        "look at both, then `rig check`",
    ),
    EndReason.OVER_LEVEL: (
        "the amplifier's gain has risen, or the rig is not the one that was checked; or channel {channel} reads too much",
        "look at the amplifier's gain and at the channel, then `rig check`",
    ),
    EndReason.GAIN_CHANGED: (
        "sensor or cable of channel {channel} loses sensitivity, or the amplifier's gain drifts; else the damping has changed "
        "this much",
        "look at both, then `rig check`; if they are sound, measure from this level on in a run of its own",
    ),
}
"""Likely cause and advice for trips that are independent of levels and locks; ``{channel}`` is the channel that tripped."""


class Trip(NamedTuple):
    """What stopped a run, as recorded by the guard."""

    reason: EndReason
    """The first cause."""
    channel: int
    """Index of the channel, -1 for none."""
    frequency_hz: float
    """Frequency of the oscillator at the end, Hz."""


class Before(NamedTuple):
    """State of the run before it tripped."""

    points: Sequence[Point[object]]
    """Points that were recorded, accepted or not."""
    locked: bool
    """Whether a lock was gained at any time in the run."""
    first: bool
    """Whether it tripped at its first point."""


class Advice(NamedTuple):
    """Two half sentences for the person at a rig that has tripped."""

    likely_cause: str
    """The most likely cause."""
    what_to_do: str
    """What to do first."""


def advice_on(trip: Trip, bench: Bench, plan: Plan, at: TrippedAt | None, before: Before) -> Advice:
    """Return the likely cause and remedy of a trip at a level, judged by what was measured before."""
    if trip.reason in BESIDE_THE_LEVEL:
        cause, what_to_do = BESIDE_THE_LEVEL[trip.reason]
        return Advice(cause.format(channel=_name(bench, trip)), what_to_do)
    if isinstance(plan, LockedPlan) and not (before.locked or before.points):
        return Advice(
            f"no lock was ever gained in this run: {POLARITY_HINT}",
            "look at the polarity of force and drive (`rig check` shows it) and at controller.frequency_window_hz",
        )
    if trip.reason in LIMITS or trip.reason is EndReason.SENSOR_OVERLOAD:
        return _on_a_limit(trip, bench, plan, at, before)
    if trip.reason in (EndReason.LOST_LOCK, EndReason.FREQUENCY_LIMIT):
        return _on_a_lock(trip, bench, plan, at)
    return Advice("not known; the line above says what was seen", "find out why before the level is tried again")


def _on_a_limit(trip: Trip, bench: Bench, plan: Plan, at: TrippedAt | None, before: Before) -> Advice:
    """Advise on a trip at a limit, from the share of the limit that earlier points reached in proportion to their level."""
    name, unit = _name(bench, trip), plan.level_unit if at is None else at.level_unit
    margin = _margin(bench, trip, unit, before.points)
    raised = f"take a less sensitive sensor for channel {name}"
    if trip.reason in LIMITS:
        key = LIMITS[trip.reason]
        now = f"limits.{key} = {getattr(bench.limits, key):g}"
        raised = f"raise {now} of the bench if specimen and rig can take it, in a run of its own"
    lowered = f"lower {'start_v' if at is not None and at.start else plan.levels_key}"
    what = "the level" if at is None else f"the level {at.text}"
    if margin is None:
        polarity = ", or polarity or sensitivity of a sensor is wrong" if before.first else ""
        then = "; `rig check` shows polarity and sensitivity" if before.first else ""
        return Advice(f"{what} is too high{polarity}", f"{lowered}, or {raised}{then}")
    share, level, key = margin
    had = f"the point before, {level:.4g} {unit}, had reached {100.0 * share:.2g} % of {key} on channel {name}"
    if at is None or share * max(at.level / level, 1.0) >= SHARE_TOO_HIGH:
        below = PROPOSED_SHARE * level / share
        bound = f" below {below:.2g} {unit}" if at is None or below < at.level else ""
        return Advice(f"{had}: {what} is too high", f"{lowered}{bound}, or {raised}")
    return Advice(
        f"{had}: {what} alone does not explain it. A jump to another response, a knock, or a sensor that reads wrong",
        f"look at the sensors of force, drive and channel {name}, and at what else moved it; then take smaller steps",
    )


def _on_a_lock(trip: Trip, bench: Bench, plan: Plan, at: TrippedAt | None) -> Advice:
    """Advise on a lock that was gained and then lost, at an end of the frequency window or within it."""
    window = plan.controller.frequency_window_hz if isinstance(plan, LockedPlan) else None
    low, high = bench.limits.frequency_hz if window is None else window
    key = "limits.frequency_hz of the bench" if window is None else "controller.frequency_window_hz"
    from_end = min(abs(trip.frequency_hz - low), abs(trip.frequency_hz - high))
    where = "" if at is None else f" at {at.text}"
    if from_end <= NEAR_WINDOW_END * (high - low):
        return Advice(
            f"the resonance{where} lies beyond {key} = [{low:g}, {high:g}]",
            "widen it if rig and specimen can take it, or lower the levels",
        )
    return Advice(
        f"a lock that had been gained broke{where} at {trip.frequency_hz:.4g} Hz, within its window: a knock, a step of the "
        "level that is too large, or the end of this resonance",
        'smaller steps or longer ramps of the level, gains by `rig tune`, or on_lost_lock = "skip"',
    )


def _name(bench: Bench, trip: Trip) -> str:
    return bench.channels[trip.channel].name if trip.channel >= 0 else "-"


def _margin(bench: Bench, trip: Trip, unit: str, points: Iterable[Point[object]]) -> tuple[float, float, str] | None:
    """Return the largest share of the tripped limit that points with levels in ``unit`` had reached (1 at the limit).

    The level of that point and the key or range of the bench that defines the limit are returned too. None if no point has
    harmonics.
    """
    known = [point for point in points if point.spectrum is not None and point.level_unit == unit]
    if trip.channel < 0 or not known:
        return None
    channel = bench.channels[trip.channel]
    key, allowed = f"the range of {channel.range_in_unit:.4g} {channel.unit}", channel.range_in_unit
    if trip.reason in LIMITS:
        key, allowed = f"limits.{LIMITS[trip.reason]}", float(getattr(bench.limits, LIMITS[trip.reason]))
    share, level = max((_peak(point, trip.channel, trip.reason) / allowed, point.level) for point in known)
    return share, level, key


def _peak(point: Point[object], channel: int, reason: EndReason) -> float:
    """Largest instantaneous value of a channel over a period, without its mean: of the signal, or of its displacement."""
    harmonics = spectrum_of(point).harmonics[channel, 1:]
    orders = np.arange(1, harmonics.size + 1)
    if LIMITS.get(reason) == "displacement_m":
        harmonics = -harmonics / (2.0 * math.pi * vibration_of(point).frequency_hz * orders) ** 2
    turns = 2j * math.pi * np.outer(np.arange(SAMPLES) / SAMPLES, orders)
    return float(np.abs((np.exp(turns) @ harmonics).real).max())
