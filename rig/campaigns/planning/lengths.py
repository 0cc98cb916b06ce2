"""Limit the duration of a plan and the size of a record held in memory. Absurd lengths are refused before anything moves."""

from collections import defaultdict

from rig.bench import Bench
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import EVALUATED, SegmentKind
from rig.tick.sequencer.segments import Segment

LONGEST_DAYS = 100.0
"""Longest duration of a whole plan if every point takes the longest time allowed for settling."""
MOST_ROWS = 100_000_000
"""Most samples of one record, which is held in memory until it is evaluated: five hours at 5000 samples/s."""
_DAY_S = 86400.0  # seconds of a day
_KEYS = {
    SegmentKind.RAMP: ("ramp_periods", "level_ramp_periods", "approach_periods", "ramp_s", "silent_s"),
    SegmentKind.SETTLE: ("settle.longest_periods",),
    SegmentKind.RECORD: ("record_periods", "periods", "mean_s"),
    SegmentKind.HOLD: ("hold_periods", "start_periods", "lock_periods", "end_periods", "transient_periods"),
    SegmentKind.SWEEP: ("rate_hz_per_s", "rate_octaves_per_min"),
    SegmentKind.LEVEL_SWEEP: ("sweep_periods", "record_periods"),
    SegmentKind.START: ("start_periods",),
    SegmentKind.RELEASE: ("decay_periods",),
}
"""Plan keys that determine the length of a segment, by kind of segment. A plan has one or more of them."""


def check_length(plan: Plan, bench: Bench) -> None:
    """Raise `ConfigurationError`, naming the keys, for a record beyond `MOST_ROWS` or a plan beyond `LONGEST_DAYS`."""
    took: dict[SegmentKind, float] = defaultdict(float)
    for segment in plan.segments(bench.sample_rate_hz):
        duration_s = duration_of(plan, segment, _lowest_hz(plan, bench))
        took[segment.kind] += duration_s
        rows = duration_s * bench.sample_rate_hz
        if rows > MOST_ROWS and segment.kind in EVALUATED:
            raise ConfigurationError(
                f"up to {rows:.3g} samples of one record at {bench.sample_rate_hz:g} samples/s",
                field=_keys(plan, segment.kind),
                allowed=f"up to {MOST_ROWS:g}",
            )
    days = sum(took.values()) / _DAY_S
    if days > LONGEST_DAYS:
        longest = max(took, key=lambda kind: took[kind])
        raise ConfigurationError(
            f"the plan may take {days:.3g} days, {took[longest] / _DAY_S:.3g} of them by this",
            field=_keys(plan, longest),
            allowed=f"up to {LONGEST_DAYS:g} days, with every point as long as it may take",
        )


def duration_of(plan: Plan, segment: Segment, frequency_hz: float, periods: float | None = None) -> float:
    """Return the duration of a segment, s. ``frequency_hz`` is that of periods that no tone gives.

    ``periods`` is the number of its periods, by default the largest that it may have.
    """
    if segment.kind is SegmentKind.SWEEP:
        return plan.sweep_s
    if segment.duration_s is not None:
        return segment.duration_s
    tone = segment.excitation
    return (segment.periods if periods is None else periods) / (frequency_hz if tone is None else tone.frequency_hz)


def _lowest_hz(plan: Plan, bench: Bench) -> float:
    """Return the lowest frequency that a loop may have, Hz."""
    return plan.controller.frequency_window_hz[0] if isinstance(plan, LockedPlan) else bench.limits.frequency_hz[0]


def _keys(plan: Plan, kind: SegmentKind) -> str:
    values = {"settle.longest_periods": plan.settle_rule.longest_periods, **dict(plan)}
    given = [key for key in _KEYS[kind] if values.get(key) is not None]
    return ", ".join(given) or kind.name.lower()
