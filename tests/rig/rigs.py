"""Benches, plans and ticks that tests of the bench share."""

from typing import Any

from controller import AmplitudeLaw, PhaseLockedLoop, preset
from rig.bench import Bench, load_bench
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings

SETTLE = SettleRule(longest_periods=300)


def bench_with(changes: dict[str, Any] | None = None, name: str = "magnet-beam", **options: Any) -> Bench:
    """A shipped bench with top-level ``changes`` and with ``options`` for its virtual driver."""
    table = load_bench(name).model_dump()
    table["driver"]["options"] |= options
    for key, value in (changes or {}).items():
        table[key] = table[key] | value if isinstance(value, dict) else value
    return Bench.model_validate(table)


def point_segments(
    *levels: float, record_periods: float = 10.0, on_failure: OnFailure = OnFailure.SKIP
) -> list[Segment]:
    """Ramp, settle and record at each level."""
    out = []
    for number, level in enumerate(levels):
        out.append(Segment(SegmentKind.RAMP, number, level, 10.0))
        out.append(Segment(SegmentKind.SETTLE, number, level, 300.0, on_failure))
        out.append(Segment(SegmentKind.RECORD, number, level, record_periods, on_failure))
    return out


def tick_for(
    bench: Bench,
    lead: float,
    *levels: float,
    law: PhaseLockedLoop | None = None,
    amplitude_law: AmplitudeLaw = AmplitudeLaw.VOLTAGE,
    **kwargs: Any,
) -> Tick:
    """A tick with the paper's controller, going through voltage levels."""
    segments = point_segments(*(levels or (0.5, 1.0)), **kwargs)
    return Tick(TickSettings(bench, law or preset("magnet-beam"), amplitude_law, SETTLE, segments), lead)
