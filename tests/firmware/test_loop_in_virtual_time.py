"""The loop on the device in virtual time: what feeds its watchdog, missed instants, a wire that takes nothing for a while.

A tone is played to the structure of the script's board, whose first channel reads the output itself.
"""

import numpy as np
import pytest

from rig.firmware.signature import arguments_for
from rig.tick.kernels import tick_block
from rig.tick.layout import SAMPLE_LOST
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from rig.tick.tick import Tick
from rig.wire.messages import (
    ARM_KEY,
    LARGEST_PIECE,
    Command,
    DeviceFlag,
    Message,
    Parameter,
    Record,
    Request,
    Rows,
    Stream,
)
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from tests.firmware.building import built_with_loop
from tests.firmware.differential import run_firmware
from tests.firmware.events import BEGIN_US, Choice, Event, Kind
from tests.firmware.loop_client import rows_of, settings_for
from tests.firmware.structure import V_PER_COUNT, readings
from vibrolock.compiled import bound

RATE_HZ, BLOCK, CHANNELS, BITS = 5000, 10, 4, 16
SAMPLE_US = 1_000_000 // RATE_HZ
WATCHDOG_US, RAMP_US = 100_000, 50_000
DEVICE = Choice(n_channels=CHANNELS, highest_rate_mhz=1000 * RATE_HZ)
LOST = 0x8000
WATCHDOG_TRIPS, MISSED = 0, 4
"""Places of counters."""
ARMED_AFTER_S, BEFORE = 0.0123, 62
"""Time from START to ARM, and sample instants in it: the structure counts them, the loop does not."""
ON_LEVEL = 1000
"""Samples after which the tone is on its level."""
STREAM = Stream(CHANNELS, BLOCK, RATE_HZ, BITS, loop=True)


def tone() -> Tick:
    """A tone of 0.4 V, behind limits that this structure, which is none, does not reach."""
    played = Excitation(25.0)
    points = [
        Segment(SegmentKind.RAMP, 0, 0.4, 2.0, excitation=played),
        Segment(SegmentKind.HOLD, 0, 0.4, 1e6, excitation=played),
    ]
    tick = settings_for(segments=points).build(0.5)
    arrays = tick.arrays
    for name in ("limit", "overload_v", "alarm_v"):
        arrays.inputs[name] = np.inf
    arrays.inputs["unit_per_volt"][0] = 1.0
    arrays.limits["displacement_m"] = 1e300
    for name in ("stuck_samples", "overload_samples", "lost_samples"):
        arrays.limits[name] = 2**40
    return tick


class Script:
    """What happens to the device; sample 0 is at ARM or a sample later."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._codec, self._now_us, self._number = Codec(), BEGIN_US, 0
        self.ask(Command.SET, Parameter.VERSION, value=2)
        self._codec.version = 2
        settings = {
            Parameter.RATE_MHZ: 1000 * RATE_HZ,
            Parameter.BLOCK: BLOCK,
            Parameter.WATCHDOG_US: WATCHDOG_US,
            Parameter.RAMP_US: RAMP_US,
            Parameter.LOOP: 1,
        }
        for parameter, value in settings.items():
            self.ask(Command.SET, parameter, value=value)
        for place, array in enumerate(tone().arrays):
            self.ask(Command.SET, Parameter.TICK_BYTES, place, array.nbytes)
        for place, array in enumerate(tone().arrays):
            data = array.tobytes()
            for at in range(0, len(data), LARGEST_PIECE):
                self.send(Record(place, at, data[at : at + LARGEST_PIECE]))
        self.ask(Command.START)
        began_us = self._now_us
        self.wait(ARMED_AFTER_S)
        self.ask(Command.ARM, value=ARM_KEY)
        assert (self._now_us - began_us) // SAMPLE_US + 1 == BEFORE

    def happens(self, kind: Kind, data: bytes = b"") -> None:
        self._now_us += 3
        self.events.append(Event(self._now_us, kind, data))

    def send(self, message: Message) -> None:
        self.happens(Kind.BYTES, frame(self._codec.encode(message)))

    def ask(self, command: int, parameter: int = 0, item: int = 0, value: int = 0) -> None:
        self._number = self._number % 255 + 1
        self.send(Request(self._number, command, parameter, item, value))

    def wait(self, seconds: float) -> None:
        self._now_us += round(1e6 * seconds)

    def stay(self, seconds: float) -> None:
        """Let the device know every now and then that its host is there."""
        for _ in range(round(seconds / 0.09)):
            self.wait(0.09)
            self.ask(Command.GET, Parameter.PING)

    def run(self) -> tuple[list[Rows], dict[int, int]]:
        """The blocks that the device has sent, and its counters by their place."""
        self.happens(Kind.NOTHING)
        sent = run_firmware(built_with_loop("script"), DEVICE.header() + b"".join(one.packed() for one in self.events))
        reader = FrameReader(self._codec, {})
        self._codec.configure(STREAM)
        reader.configure(STREAM)
        told = reader.feed(b"".join(event.data for event in sent if event.kind == Kind.BYTES))
        counters = np.frombuffer(sent[-1].data, "<u4")
        return [one for one in told if isinstance(one, Rows)], dict(enumerate(counters.tolist()))


def expected(n: int, missed: tuple[int, ...] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Readings and rows of n samples as the loop makes them here, with the structure of the script's board."""
    tick = tone()
    arguments = arguments_for(tick, 1)
    run = bound(tick_block, *arguments)
    all_readings, all_rows = tick.buffers(n)
    step_v = V_PER_COUNT[BITS]
    for sample in range(n):
        count = np.rint(arguments.outputs / step_v).astype(np.int64)
        arguments.volts[:] = np.nan if sample in missed else readings(count, BEFORE + sample, CHANNELS, BITS) * step_v
        arguments.flags[:] = LOST if sample in missed else 0
        run(*arguments)
        all_readings[sample], all_rows[sample] = arguments.readings[0], arguments.rows[0]
    return all_readings, all_rows


def put_out_v(blocks: list[Rows]) -> np.ndarray:
    """The voltage on the converter, as the first channel has read it."""
    return np.concatenate([one.readings[:, 0] for one in blocks])


def require_equal(blocks: list[Rows], missed: tuple[int, ...] = ()) -> None:
    """Each block is to the bit what the loop makes here, at the place that it tells."""
    wanted, wanted_rows = expected(blocks[-1].first + BLOCK, missed)
    for one in blocks:
        at = slice(one.first, one.first + BLOCK)
        assert rows_of(one).tobytes() == wanted_rows[at].tobytes(), one.first
        assert one.readings.tobytes() == wanted[at].tobytes(), one.first


@pytest.mark.slow
def test_requests_of_any_kind_feed_the_watchdog_and_nothing_else_does():
    script = Script()
    script.stay(0.9)
    blocks, counters = script.run()
    assert counters[WATCHDOG_TRIPS] == 0
    assert [one.first for one in blocks] == list(range(0, BLOCK * len(blocks), BLOCK))
    require_equal(blocks)
    assert np.abs(put_out_v(blocks)[ON_LEVEL:]).max() > 0.399


def test_without_requests_the_watchdog_ramps_the_output_down_and_the_rows_go_on():
    script = Script()
    script.stay(0.45)
    script.wait(0.5)
    blocks, counters = script.run()
    assert counters[WATCHDOG_TRIPS] == 1
    volts = put_out_v(blocks)
    bitten = next(one.first for one in blocks if one.flags & DeviceFlag.WATCHDOG)
    fed = round(0.45 * RATE_HZ)
    assert abs(bitten - fed - WATCHDOG_US // SAMPLE_US) <= BLOCK
    coming_down = volts[bitten + BLOCK : bitten + RAMP_US // SAMPLE_US - BLOCK]
    step_v = V_PER_COUNT[BITS]
    assert np.abs(np.diff(coming_down, 2)).max() <= 2.01 * step_v  # a straight line, to the rounding
    assert not volts[bitten + RAMP_US // SAMPLE_US + BLOCK :].any()
    rows = np.concatenate([rows_of(one) for one in blocks])
    assert np.abs(rows["output_v"][-300:]).max() > 0.399  # what the loop goes on to compute
    assert all(one.flags & DeviceFlag.WATCHDOG for one in blocks if one.first > bitten)


def test_an_instant_that_is_missed_is_a_lost_sample_of_the_loop_and_not_a_lost_block():
    script = Script()
    script.stay(0.27)
    script.happens(Kind.MISS)
    script.stay(0.18)
    blocks, counters = script.run()
    rows = np.concatenate([rows_of(one) for one in blocks])
    (missed,) = np.flatnonzero(rows["flags"] & SAMPLE_LOST)
    assert np.isnan(np.concatenate([one.readings for one in blocks])[missed]).all()
    assert [one.first for one in blocks] == list(range(0, BLOCK * len(blocks), BLOCK))
    assert counters[MISSED] == 1
    assert blocks[-1].dropped == 0
    require_equal(blocks, (int(missed),))


def test_blocks_that_the_wire_does_not_take_are_counted_and_the_loop_goes_on():
    script = Script()
    script.stay(0.27)
    script.happens(Kind.SHUT)
    script.stay(0.9)
    script.happens(Kind.OPEN)
    script.stay(0.27)
    blocks, _ = script.run()
    missing = blocks[-1].first + BLOCK - BLOCK * len(blocks)
    assert missing > 0
    assert blocks[-1].dropped == missing
    require_equal(blocks)


def test_the_emergency_stop_is_0_v_from_the_next_instant_on():
    script = Script()
    script.stay(0.45)
    script.happens(Kind.PRESS)
    script.stay(0.18)
    blocks, _ = script.run()
    volts = put_out_v(blocks)
    last = int(np.flatnonzero(volts)[-1])
    flagged = [one.first for one in blocks if one.flags & DeviceFlag.EMERGENCY_STOP]
    assert abs(flagged[0] - 0.45 * RATE_HZ) < 2 * BLOCK
    assert flagged[0] - BLOCK <= last < flagged[0] + BLOCK
    assert flagged == list(range(flagged[0], blocks[-1].first + BLOCK, BLOCK))
