"""A rig held at a tone, for as long as a test wants."""

from controller import AmplitudeLaw, preset
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule
from rig.tick.tick import TickSettings
from tests.rig.rigs import bench_with

RATE_HZ = 1000.0
VOLTS = 0.5


def slow_bench(driver="noting", block=10, **options):
    """The magnet beam at 1 kHz in blocks of 10 ms, with a short ramp."""
    converter = {"substeps": 10, "oversampling": 5, "anti_alias_hz": 400.0}
    changes = {"sample_rate_hz": RATE_HZ, "block": block}
    table = bench_with(
        changes | {"limits": {"ramp_down_s": 0.3, "frequency_hz": (8.0, 200.0)}}, converter=converter
    ).model_dump()
    table["driver"] = {"name": driver, "options": table["driver"]["options"] | options}
    return type(bench_with()).model_validate(table)


def tone(bench, hold_s):
    """Up to half a volt at 20 Hz in 0.1 s, there for a while, down."""
    excitation = Excitation(20.0)
    segments = [
        Segment(SegmentKind.RAMP, -1, VOLTS, 2.0, excitation=excitation),
        Segment(SegmentKind.HOLD, -1, VOLTS, 20.0 * hold_s, excitation=excitation),
    ]
    return TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), segments)
