"""Frames that are damaged on the way: gaps in their place, counted; every other row as it was measured; 0 V at the end."""

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest

from rig.daq import LOST
from rig.drivers.wire import WireOptions
from rig.emulator import Device, VirtualPlant
from rig.emulator.parameters import described
from rig.errors import DaqProtocol, DaqTimeout, DaqWatchdog
from rig.wire.messages import DeviceState, Message, Output, Request
from tests.refused import refused
from tests.rig.drivers.test_wire import BLOCKS, answers, drive, message_of, virtual
from tests.rig.rigs import bench_with
from tests.rig.wire.mangled import MangledDAQ
from tests.rig.wire.memory_link import MemoryDAQ, MemoryLink

EVERY = 7
BLOCK = 5
QUEUE = 3
CUT = 20


def garbage(seed: int) -> bytes:
    return np.random.default_rng(seed).integers(1, 256, 40, np.uint8).tobytes()


def flipped(data: bytes, number: int) -> bytes:
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    bits[number * 37 % (bits.size - 8)] ^= 1  # any but those of the zero that ends the frame
    return np.packbits(bits).tobytes()


DAMAGE: dict[str, tuple[Callable[[bytes, int], bytes], tuple[int, ...], str]] = {
    "garbage that ends before the frame": (lambda data, number: garbage(number) + b"\0" + data, (), "garbage_bytes"),
    "garbage right before the frame": (lambda data, number: garbage(number) + data, (0,), "garbage_bytes"),
    "a frame cut short, its end there": (lambda data, number: data[:CUT] + b"\0", (0,), "crc_errors"),
    "a frame cut short, its end lost": (lambda data, number: data[:CUT], (0, 1), "garbage_bytes"),
    "a frame without its beginning": (lambda data, number: data[CUT:], (0,), "crc_errors"),
    "a bit that has flipped": (flipped, (0,), "garbage_bytes"),
    "a frame that comes twice": (lambda data, number: data + data, (), "repeated_blocks"),
    "a frame that is lost": (lambda data, number: b"", (0,), "lost_samples"),
    "far more garbage than any frame": (
        lambda data, number: 300 * garbage(number) + b"\0" + data,
        (),
        "oversize_frames",
    ),
}


@pytest.mark.parametrize("lockstep", [True, False])
@pytest.mark.parametrize("what", DAMAGE)
def test_damage_costs_the_damaged_blocks_and_no_other(what: str, lockstep: bool) -> None:
    mangle, costs, counter = DAMAGE[what]
    daq = MangledDAQ(
        bench_with(),
        3,
        WireOptions(queue_blocks=QUEUE),
        lambda data, number: mangle(data, number) if number % EVERY == 0 else data,
        lockstep=lockstep,
    )
    inputs, flags = answers(daq, BLOCK)
    hit = np.arange(EVERY, BLOCKS + 1, EVERY) - 1
    expected = np.zeros(BLOCKS, bool)
    for after in costs:
        expected[hit[hit + after < BLOCKS] + after] = True
    lost = np.isnan(inputs).all(axis=1)
    np.testing.assert_array_equal(lost, np.repeat(expected, BLOCK))
    np.testing.assert_array_equal(flags, np.where(lost, LOST, 0))
    np.testing.assert_array_equal(inputs[~lost], virtual(BLOCK, QUEUE)[~lost])
    assert daq.counters["lost_samples"] == np.count_nonzero(lost)
    assert daq.counters[counter] >= hit.size
    assert daq.device.state is DeviceState.IDLE
    assert not daq.device.output_v.any()


def test_a_line_that_damages_everything_ends_the_run_with_what_was_counted() -> None:
    daq = MangledDAQ(bench_with(), 3, WireOptions(), lambda data, number: flipped(data, number), lockstep=False)
    with daq:
        daq.start(BLOCK)
        with refused(DaqWatchdog, "crc-errors"):  # for the host waits, and hands over nothing meanwhile
            drive(daq, 2)
    assert not daq.device.output_v.any()


def test_outputs_that_are_damaged_on_the_way_hold_the_last_and_then_bite() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    heard, lose = daq.device.handle, [0]

    def damaged(message: Message, now_s: float) -> None:
        if isinstance(message, Output) and lose[0]:
            lose[0] -= 1
        else:
            heard(message, now_s)

    daq.device.handle = damaged  # type: ignore[method-assign]
    with daq:
        daq.start(BLOCK)
        drive(daq, 20, BLOCK)
        lose[0] = 2
        drive(daq, 20, BLOCK)
        assert daq.counters["output_held"] == 2 * BLOCK
        lose[0] = 10_000
        with refused(DaqWatchdog, "watchdog"):
            drive(daq, 10_000, BLOCK)
    assert not daq.device.output_v.any()


def test_two_devices_alike_in_everything_are_noticed_by_their_double_answers() -> None:
    daq = MemoryDAQ(bench_with())
    twin = Device(VirtualPlant(bench_with()), described(daq.device.plant), MemoryLink(daq.wire, host=False))
    heard = daq.device.handle

    def both(message: Message, now_s: float) -> None:
        heard(message, now_s)
        twin.handle(message, now_s)

    daq.device.handle = both  # type: ignore[method-assign]
    assert "two devices answer as one" in message_of(DaqProtocol, daq)


def test_a_device_whose_answers_come_too_late_is_said_to_be_slow() -> None:
    daq = MemoryDAQ(bench_with())
    heard = daq.device.handle

    waiting: deque[Message] = deque()

    def slowly(message: Message, now_s: float) -> None:
        waiting.append(message)
        if len(waiting) > 2:  # asked every 0.1 s
            heard(waiting.popleft(), now_s)

    daq.device.handle = slowly  # type: ignore[method-assign]
    assert "later than 0.1 s" in message_of(DaqTimeout, daq)
    assert daq.counters["stray_answers"] > 0


def test_round_trips_are_measured_on_after_the_answer_to_one_was_lost() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(BLOCK)
        drive(daq, 10, BLOCK)
        before = daq.statistics["round_trips"]
        heard, lost = daq.device.handle, []

        def one_lost(message: Message, now_s: float) -> None:
            if isinstance(message, Request) and not lost:
                lost.append(message)
            else:
                heard(message, now_s)

        daq.device.handle = one_lost  # type: ignore[method-assign]
        drive(daq, 1000, BLOCK)  # a second
        assert lost
        assert daq.statistics["round_trips"] - before == pytest.approx(19, abs=1)
