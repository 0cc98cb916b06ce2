"""A host that is silent for a while, in virtual time: the vibration goes on as if it were not; past the watchdog it ends."""

import math
import struct
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from rig.wire.messages import ARM_KEY, Command, Parameter
from rig.wire.serial.frames import frame, payload_of
from tests.firmware.building import built
from tests.firmware.differential import run_firmware
from tests.firmware.events import BEGIN_US, Choice, Event, Kind

RATE_HZ, BLOCK, QUEUE = 5000, 10, 2
BLOCK_US = 1_000_000 * BLOCK // RATE_HZ
WATCHDOG_US, RAMP_US = 100_000, 50_000
AMPLITUDE = 16_000
GAPS = 200
HELD, WATCHDOG, CONTINUED = 4, 8, 32
DEVICE = Choice(n_channels=1, highest_rate_mhz=1000 * RATE_HZ)


class Block(NamedTuple):
    """A block that the device has sent."""

    first: int
    flags: int
    output: np.ndarray
    """What its one input has read: the output itself, counts [n]."""
    readback: np.ndarray | None
    """What the device says that it has put out instead of what was handed over, counts [n]."""


class Host:
    """Sends a sine in the protocol's version 1 or 2, written from its page; blocks of outputs go at their time, or later."""

    def __init__(self, period: float, version: int = 2) -> None:
        self.period, self.version = period, version
        self.events: list[Event] = []
        self._number = 0
        self._began_us = BEGIN_US
        settings = {
            Parameter.VERSION: version,
            Parameter.RATE_MHZ: 1000 * RATE_HZ,
            Parameter.BLOCK: BLOCK,
            Parameter.QUEUE: QUEUE,
            Parameter.WATCHDOG_US: WATCHDOG_US,
            Parameter.RAMP_US: RAMP_US,
        }
        for parameter, value in settings.items():
            self._ask(Command.SET, parameter, value)
        self._ask(Command.START)
        self._began_us = self.events[-1].time_us
        self._ask(Command.ARM, value=ARM_KEY)

    def _send(self, time_us: int, payload: bytes) -> None:
        self.events.append(Event(time_us, Kind.BYTES, frame(payload)))

    def _ask(self, command: Command, parameter: int = 0, value: int = 0) -> None:
        self._number += 1
        time_us = self._began_us + self._number
        self._send(time_us, struct.pack("<BBHBBBBI", self.version, 1, 0, self._number, command, parameter, 0, value))

    def sine(self, first: int, n: int) -> np.ndarray:
        """What it sends for samples ``first`` to ``first + n - 1``, counts."""
        return np.rint(AMPLITUDE * np.sin(2 * np.pi / self.period * np.arange(first, first + n))).astype("<i2")

    def send_block(self, number: int, time_us: int, ramp: int = 0) -> None:
        """Send the outputs of a block, at a time since START."""
        first = number * BLOCK
        head = struct.pack("<BBHQ", self.version, 4, number & 0xFFFF, first)
        if self.version > 1:
            head += struct.pack("<II", round(65536 * self.period), ramp)
        self._send(self._began_us + time_us, head + self.sine(first, BLOCK).tobytes())

    def drive(self, blocks: int, silent: list[tuple[int, int]]) -> None:
        """Send so many blocks a queue ahead, but within each (begin, end), us, not before its end."""
        for number in range(QUEUE, blocks):
            time_us = (number - QUEUE) * BLOCK_US + 700
            held_up = (end for begin, end in silent if begin <= time_us < end)
            self.send_block(number, max(time_us, *held_up, 0))
        self.events.sort(key=lambda event: event.time_us)

    def blocks(self) -> list[Block]:
        """What the device makes of it."""
        script = DEVICE.header() + b"".join(event.packed() for event in self.events)
        sent = b"".join(one.data for one in run_firmware(built("script"), script) if one.kind == Kind.BYTES)
        return list(_blocks_in([payload_of(one) for one in sent.split(b"\0") if one]))


def _blocks_in(payloads: list[bytes]):
    readback: tuple[int, np.ndarray] | None = None
    for payload in payloads:
        if payload[1] == 7:
            readback = struct.unpack_from("<Q", payload, 4)[0], np.frombuffer(payload, "<i2", offset=12)
        elif payload[1] == 3:
            first, _, _, flags = struct.unpack_from("<QQIH", payload, 4)
            assert readback is None or readback[0] == first
            yield Block(first, flags, np.frombuffer(payload, "<i2", offset=28), readback[1] if readback else None)
            readback = None
        else:
            assert readback is None  # it goes immediately before its samples


class Gone(NamedTuple):
    """What became of many gaps."""

    deviation: np.ndarray
    """From what the host would have sent, by gap, counts."""
    flags: int
    """Of all blocks whose output differs or that are flagged."""


@cache
def gaps(silent_ms: int, period: float, version: int = 2) -> Gone:
    """Gaps of ``silent_ms`` that begin at phases all over the period, each after some periods of good outputs."""
    host, begins, at_us = Host(period, version), [], 400_000
    apart_us = 1000 * silent_ms + 4 * BLOCK_US + round(2e6 * (period + 4) / RATE_HZ)
    for number in range(GAPS):
        begins.append(at_us + round(1e6 * period / RATE_HZ * number / GAPS))
        at_us += apart_us + round(1e6 * period / RATE_HZ)
    host.drive(at_us // BLOCK_US, [(begin, begin + 1000 * silent_ms) for begin in begins])
    deviation, flags = np.zeros(GAPS), 0
    for block in host.blocks():
        if block.first < 400_000 * RATE_HZ // 1_000_000:
            continue
        off = np.abs(block.output.astype(int) - host.sine(block.first, BLOCK)).max()
        number = np.searchsorted(begins, block.first * 1_000_000 // RATE_HZ, "right") - 1
        deviation[number] = max(deviation[number], off)
        flags |= block.flags
        is_flagged = bool(block.flags & (HELD | CONTINUED))
        assert is_flagged or off == 0
        assert (block.readback is not None) == (is_flagged and version > 1)
        if block.readback is not None:
            np.testing.assert_array_equal(block.readback, block.output)
    return Gone(deviation, flags)


def most_off(period: float, samples: int) -> float:
    """By how much a sine that is continued may be off, counts.

    The cubic's remainder, the peak between two outputs that bounds it, the rounding of the period, and that of outputs, which
    the cubic's weights make larger by a quarter.
    """
    step = 2 * math.pi / period
    cubic = AMPLITUDE * 9 / 16 / 24 * step**4
    peak = AMPLITUDE * (1 - math.cos(step / 2))
    drift = AMPLITUDE * step * (samples / period + 1) / 131072
    return cubic + peak + drift + 0.5 * 1.25 + 1.0


@pytest.mark.parametrize(
    ("silent_ms", "period"), [(20, 105.713), (50, 105.713), (90, 105.713), (50, 1000.29), (50, 16.37)]
)
def test_a_vibration_goes_on_over_a_gap_at_every_phase(silent_ms: int, period: float) -> None:
    gone = gaps(silent_ms, period)
    assert gone.flags == CONTINUED
    assert (gone.deviation > 0).sum() > GAPS // 2
    assert gone.deviation.max() <= most_off(period, silent_ms * RATE_HZ // 1000)


def test_without_a_period_the_output_is_held_and_far_off() -> None:
    gone = gaps(20, 105.713, version=1)
    assert gone.flags == HELD
    assert np.median(gone.deviation) > AMPLITUDE / 2


@pytest.mark.parametrize("version", [1, 2])
def test_past_the_watchdog_the_output_goes_to_0_v_in_a_straight_line_from_where_it_is(version: int) -> None:
    host = Host(105.713, version)
    begin_us = 600_700
    host.drive(QUEUE + begin_us // BLOCK_US, [])
    host.events.append(Event(host.events[-1].time_us + 300_000, Kind.NOTHING))
    blocks = host.blocks()
    fed_us = max(event.time_us for event in host.events if event.time_us < host._began_us + begin_us) - host._began_us
    bites_at = (fed_us + WATCHDOG_US) * RATE_HZ / 1e6
    output = np.concatenate([block.output for block in blocks]).astype(int)
    last = math.floor(bites_at)
    held = output[last]
    line = np.array(
        [held * (1 - (index - bites_at) * 1e6 / RATE_HZ / RAMP_US) for index in range(last + 1, output.size)]
    )
    down = np.where(np.arange(line.size) * 1e6 / RATE_HZ < RAMP_US, line, 0.0)
    np.testing.assert_allclose(output[last + 1 :], np.where(line * np.sign(held) > 0, down, 0.0), atol=1.0)
    flags = [block.flags for block in blocks if block.first > begin_us * RATE_HZ // 1_000_000 + QUEUE * BLOCK]
    goes_on = CONTINUED if version > 1 else HELD
    assert set(flags) == {goes_on, goes_on | WATCHDOG, WATCHDOG}
    assert not output[-BLOCK:].any()


def test_a_ramp_to_0_v_goes_on_below_the_host_s_and_ends_with_it() -> None:
    """A raised cosine, of which the host sends a part and then is silent for good."""
    period, host = 105.713, Host(105.713)
    ramp_from, ramp_samples = 300 * BLOCK, 400
    envelope = lambda index: 0.5 + 0.5 * np.cos(np.pi * np.clip((index - ramp_from) / ramp_samples, 0.0, 1.0))  # noqa: E731
    whole = host.sine
    host.sine = lambda first, n: np.rint(whole(first, n) * envelope(np.arange(first, first + n))).astype("<i2")  # type: ignore[method-assign]
    silent_from = 325
    for number in range(QUEUE, silent_from):
        left = ramp_from + ramp_samples - (number + 1) * BLOCK
        host.send_block(number, (number - QUEUE) * BLOCK_US + 700, left if number >= 300 else 0)
    host.events.append(Event(host.events[-1].time_us + 90_000, Kind.NOTHING))
    blocks = host.blocks()
    output = np.concatenate([block.output for block in blocks]).astype(int)
    gone_on = np.arange(silent_from * BLOCK, output.size)
    last = np.abs(output[silent_from * BLOCK - math.ceil(period) - 4 : silent_from * BLOCK]).max()
    assert (np.abs(output[gone_on]) <= last).all()
    end = ramp_from + ramp_samples
    assert not output[end:].any()
    assert np.abs(output[end - 100 : end]).max() > 0
    assert {block.flags for block in blocks if block.first >= silent_from * BLOCK} == {CONTINUED}
