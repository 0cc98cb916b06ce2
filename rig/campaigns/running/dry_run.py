"""What a run would do: levels, duration, periods, disk space, and what arms it. Nothing is opened or driven."""

import math
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

from rig.arming.arming import cautions_of
from rig.arming.bench_memory import memory_of
from rig.bench import Bench
from rig.campaigns.planning.lengths import check_length, duration_of
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.text.durations import duration
from rig.text.json_values import JsonValue
from rig.text.levels import in_shown_unit
from rig.tick.layout import recorded_row
from rig.tick.sequencer.layout import EVALUATED, SegmentKind

MOST_LEVELS = 20  # levels that are listed; chosen: two lines
SLOW, FAST = 25.0, 70.0
"""Times real time of one process with the evaluation of its points: of the magnet beam's backbone on two machines."""
START_S, SLOWEST = 2.0, 10.0
"""Time until a virtual rig runs, and its least times real time: of a sweep of the magnet beam beside other work."""


@dataclass(frozen=True)
class Amount:
    """What a run takes if every point settles as soon as it can, or if every point takes as long as it may."""

    periods: float
    """Periods of the vibration, as far as the plan counts in them."""
    duration_s: float
    """Time under drive, s."""
    disk_bytes: float
    """Size of what is stored while the run goes on, bytes; the file that is left is smaller."""


@dataclass(frozen=True)
class DryRun:
    """A plan on a bench, before anything is driven."""

    kind: str
    bench: str
    points: int
    levels: tuple[float, ...]
    """Distinct levels in the order of measurement, in the plan's unit."""
    level_unit: str
    frequency_hz: float
    """Frequency at which periods were counted, Hz."""
    least: Amount
    most: Amount
    free_bytes: int
    """Free space in the folder of the recording, bytes."""
    virtual: bool
    arming: tuple[str, ...]
    """What arms the bench, and what speaks against it now, one line each."""

    def to_json(self) -> dict[str, JsonValue]:
        """Return it as plain data."""
        return {**asdict(self), "levels": list(self.levels), "arming": list(self.arming)}

    def lines(self) -> list[str]:
        """Return it as lines of text."""
        shown = [f"{in_shown_unit(level, self.level_unit)[0]:.4g}" for level in self.levels]
        if len(shown) > MOST_LEVELS:
            shown = [*shown[: MOST_LEVELS // 2], "...", *shown[-MOST_LEVELS // 2 :]]
        unit = in_shown_unit(0.0, self.level_unit)[1]
        least, most = self.least, self.most
        clock = "; a virtual rig does not wait for the clock" if self.virtual else ""
        return [
            f"plan      {self.kind} on the bench {self.bench}, {self.points} point{'s' * (self.points != 1)}",
            f"levels    {len(self.levels)}: {', '.join(shown)} {unit}",
            f"duration  {_between(duration(least.duration_s), duration(most.duration_s))}{clock}",
            f"periods   {_between(f'{least.periods:.0f}', f'{most.periods:.0f}')}, at {self.frequency_hz:.4g} Hz",
            f"disk      {_between(_size(least.disk_bytes), _size(most.disk_bytes))}; {_size(self.free_bytes)} free",
            *(f"{'arming' if not number else '':10}{line}" for number, line in enumerate(self.arming)),
            "nothing was driven",
        ]


def expected_duration(plan: Plan, bench: Bench, *, by_the_clock: bool) -> str:
    """Return how long a run takes, in words: at least, and at most for plans whose points settle; empty if that is unknown."""
    found = dry_run(plan, bench, Path("recording.h5"))
    least_s, most_s = found.least.duration_s, found.most.duration_s
    if by_the_clock:
        return _between(duration(least_s), duration(most_s))
    quick, slow = (duration(START_S + least_s / speed) for speed in (FAST, SLOWEST))
    return f"some {quick} to {slow} on a virtual rig for {duration(least_s)} of test"


def dry_run(plan: Plan, bench: Bench, output: Path) -> DryRun:
    """Return what a run of this plan would do; raise the same `ConfigurationError` as a run if plan and bench do not fit."""
    plan.check(bench)
    check_length(plan, bench)
    frequency_hz = bench.specimen.linear_frequency_hz
    if isinstance(plan, LockedPlan):
        low, high = plan.controller.frequency_window_hz
        frequency_hz = min(max(frequency_hz, low), high)
    targets = plan.targets()
    return DryRun(
        kind=plan.kind,
        bench=bench.name,
        points=len(targets),
        levels=tuple(dict.fromkeys(target.level for target in targets)),
        level_unit=plan.level_unit,
        frequency_hz=frequency_hz,
        least=_amount(plan, bench, frequency_hz, float(plan.settle_rule.shortest_periods)),
        most=_amount(plan, bench, frequency_hz, math.inf),
        free_bytes=shutil.disk_usage(output.absolute().parent).free,
        virtual=bench.driver.name == "virtual",
        arming=_arming(plan, bench),
    )


def _amount(plan: Plan, bench: Bench, frequency_hz: float, settling_periods: float) -> Amount:
    """Return what a run takes if no point settles for longer than ``settling_periods``."""
    row_bytes, rate_hz = recorded_row(len(bench.channels)).itemsize, bench.sample_rate_hz
    periods = duration_s = disk_bytes = 0.0
    for segment in plan.segments(rate_hz):
        settling = segment.kind is SegmentKind.SETTLE
        taken = min(segment.periods, settling_periods) if settling else segment.periods
        seconds = duration_of(plan, segment, frequency_hz, taken)
        stride = plan.row_stride(segment.point, rate_hz, evaluated=segment.kind in EVALUATED)
        duration_s += seconds
        tone = None if segment.kind is SegmentKind.SWEEP else segment.excitation
        periods += seconds * (frequency_hz if tone is None else tone.frequency_hz)
        disk_bytes += seconds * rate_hz / stride * row_bytes
    return Amount(periods, duration_s + bench.limits.ramp_down_s, disk_bytes)


def _arming(plan: Plan, bench: Bench) -> tuple[str, ...]:
    if bench.driver.name == "virtual":
        return ("nothing: the bench is virtual",)
    how = "a person at a terminal, who types the bench's name, or --arm"
    if bench.arming.automated:
        how = "the bench itself ([arming] automated), or a person"
    memory = memory_of(bench)
    against = [] if memory.trip is None else [f"the last run tripped: {memory.trip.text}; only a person may arm"]
    against += cautions_of(bench, memory, plan.kind, None)
    return (how, *(f"CAUTION {caution}" for caution in against))


def _between(least: str, most: str) -> str:
    return (
        f"about {least}" if least == most else f"about {least} if every point settles as soon as it can, at most {most}"
    )


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{max(count / 1e6, 0.1):.1f} MB"
