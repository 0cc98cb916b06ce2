"""Periods and readbacks on a bus: when they are told, what holds until then, and what becomes of them when frames are lost."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.errors import DaqRefused
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame
from rig.wire.can.readbacks import Readbacks
from rig.wire.messages import Output, Readback, Samples, Stream
from tests.firmware.events import protocol_of
from tests.refused import refused

RATE_HZ = 1000.0
EVERY = 10  # samples in 10 ms
BUSES = [(True, 1), (True, 10), (True, 40), (False, 1), (False, 3), (False, 10)]


def ends(fd: bool, n: int) -> tuple[CanCodec, CanCodec]:
    """Device and host, speaking version 2."""
    both = [CanCodec(protocol_of(4, fd, 3), device, {}) for device in (True, False)]
    for end in both:
        end.speak(2)
        end.configure(Stream(4, n, RATE_HZ, 16, 1))
    return both[0], both[1]


def output(j: int, n: int, period: int = 0, ramp: int = 0) -> Output:
    return Output((j + 1) * n, np.arange(j, j + n).astype(np.int16), 0, period, ramp)


def told(frames: list[Frame]) -> list[bytes]:
    return [frame.data for frame in frames if frame.identifier == 0x053]


def heard(device: CanCodec, frames: list[Frame]) -> list[tuple[int, int, int]]:
    got = [message for frame in frames if isinstance(message := device.decode(frame), Output)]
    return [(one.first, one.period, one.ramp) for one in got]


@pytest.mark.parametrize(("fd", "n"), BUSES)
def test_a_period_that_stays_is_told_once_and_holds(fd: bool, n: int) -> None:
    device, host = ends(fd, n)
    for j in range(300):
        frames = host.encode(output(j, n, 0x21_8000))
        assert told(frames) == ([bytes.fromhex("0080210000000000")] if j == 0 else [])
        assert heard(device, frames) == [((j + 1) * n, 0x21_8000, 0)]


@pytest.mark.parametrize(("fd", "n"), BUSES)
def test_a_period_that_changes_is_told_every_10_ms_at_most_and_at_once_where_it_begins_or_ends(
    fd: bool, n: int
) -> None:
    device, host = ends(fd, n)
    sent, last = [], 0
    for j in range(200):
        period = (20 << 16) + j if j % 50 < 40 else 0
        frames = host.encode(output(j, n, period))
        ((_, got, _),) = heard(device, frames)
        assert (got == 0) == (period == 0)
        if told(frames):
            sent.append(j)
            last = period
        assert got == last
    begins_and_ends = {j for j in range(200) if j % 50 in (0, 40)}
    for before, after in pairwise(sent):
        assert after in begins_and_ends or (after - before) * n >= EVERY
        assert after in begins_and_ends or (after - before) * n < EVERY + n
    assert begins_and_ends <= set(sent)


@pytest.mark.parametrize(("fd", "n"), BUSES)
def test_a_ramp_is_told_once_and_counts_down_by_itself(fd: bool, n: int) -> None:
    device, host = ends(fd, n)
    length = 12 * n + 1
    for j in range(40):
        left = length - j * n
        period, ramp = (20 << 16, left) if left > 0 else (0, 0)
        frames = host.encode(output(j, n, period, ramp))
        assert bool(told(frames)) == (j == 0)
        assert heard(device, frames) == [((j + 1) * n, period, ramp)]


@pytest.mark.parametrize("fd", [True, False])
def test_a_ramp_that_begins_ends_or_is_another_is_told_at_once(fd: bool) -> None:
    device, host = ends(fd, 1)
    ramps = [0, 0, 100, 99, 50, 49, 0, 0]
    sent = [host.encode(output(j, 1, 20 << 16, ramp)) for j, ramp in enumerate(ramps)]
    assert [bool(told(frames)) for frames in sent] == [True, False, True, False, True, False, True, False]
    assert [heard(device, frames)[0][2] for frames in sent] == ramps


def test_a_ramp_that_is_over_leaves_nothing_to_go_on_with_even_if_its_end_is_not_told() -> None:
    device, host = ends(True, 10)
    assert heard(device, host.encode(output(0, 10, 20 << 16, 25))) == [(10, 20 << 16, 25)]
    got = [heard(device, [f for f in host.encode(output(j, 10)) if f.identifier != 0x053])[0] for j in (1, 2, 3, 4)]
    assert got == [(20, 20 << 16, 15), (30, 20 << 16, 5), (40, 0, 0), (50, 0, 0)]


def test_a_block_that_is_lost_does_not_lengthen_the_ramp() -> None:
    device, host = ends(True, 10)
    heard(device, host.encode(output(0, 10, 20 << 16, 100)))
    host.encode(output(1, 10, 20 << 16, 90))
    assert heard(device, host.encode(output(2, 10, 20 << 16, 80))) == [(30, 20 << 16, 80)]


def test_what_was_not_sent_is_told_with_the_next_block() -> None:
    _, host = ends(True, 10)
    assert told(host.encode(output(0, 10, 20 << 16)))
    host.forget_told()
    assert told(host.encode(output(1, 10, 20 << 16)))
    assert not told(host.encode(output(2, 10, 20 << 16)))


def test_a_start_begins_with_no_period() -> None:
    device, host = ends(True, 10)
    heard(device, host.encode(output(0, 10, 20 << 16)))
    for end in (device, host):
        end.configure(Stream(4, 10, RATE_HZ, 16, 1))
    assert heard(device, host.encode(output(0, 10))) == [(10, 0, 0)]
    assert told(host.encode(output(1, 10, 20 << 16)))


def counts_of(j: int, n: int) -> np.ndarray:
    return np.random.default_rng(j).integers(-32768, 32768, n).astype(np.int16)


def blocks(host: CanCodec, frames: list[Frame]) -> list[Readback | Samples]:
    return [one for frame in frames if isinstance(one := host.decode(frame), Readback | Samples)]


@pytest.mark.parametrize(("fd", "n"), BUSES)
def test_readbacks_arrive_as_they_were_sent_before_their_samples_and_beyond_the_wrap_of_their_index(
    fd: bool, n: int
) -> None:
    device, host = ends(fd, n)
    for j in range(0, 3 * 65536 // n, 97):
        host._here = max(0, j - 5) * n  # a few blocks are behind
        frames = device.encode(Readback(j * n, counts_of(j, n)))
        assert all(frame.identifier == 0x063 and frame.fd == fd for frame in frames)
        assert len(frames) == -(-n // (31 if fd else 3))
        (got,) = blocks(host, frames)
        assert isinstance(got, Readback)
        assert got.first == j * n
        np.testing.assert_array_equal(got.counts, counts_of(j, n))
    assert not any(host._counters.values())


def test_a_readback_is_taken_for_one_near_the_samples_that_have_come() -> None:
    device, host = ends(True, 40)
    for j in range(70000 // 40):
        for frame in device.encode(Samples(j * 40, np.zeros((40, 4), np.int16))):
            host.decode(frame)
    (got,) = blocks(host, device.encode(Readback(70000, counts_of(1, 40))))
    assert got.first == 70000


def test_readbacks_of_two_blocks_in_the_other_order_both_arrive() -> None:
    device, host = ends(False, 10)
    later, earlier = (device.encode(Readback(first, counts_of(first, 10))) for first in (10, 0))
    assert [one.first for one in blocks(host, [*later, *earlier])] == [10, 0]


def test_the_frames_of_a_readback_are_those_of_the_page() -> None:
    counts = np.array([1, -2, 3, 4, 5], np.int16)
    classical = Readbacks(0x061, 5, False).frames(65535, counts)
    assert [frame.data.hex(" ") for frame in classical] == ["ff ff 01 00 fe ff 03 00", "02 00 04 00 05 00 00 00"]
    (fd,) = Readbacks(0x061, 5, True).frames(65535, counts)
    assert fd.data.hex(" ") == "ff ff 01 00 fe ff 03 00 04 00 05 00"
    assert [len(frame.data) for frame in Readbacks(0x061, 33, True).frames(0, np.zeros(33, np.int16))] == [64, 6]


@settings(deadline=None, max_examples=60)
@given(st.sampled_from([bus for bus in BUSES if bus[1] >= 10]), st.data())
def test_a_readback_of_which_a_frame_is_missing_or_wrong_is_none(bus: tuple[bool, int], data: st.DataObject) -> None:
    fd, n = bus
    device, host = ends(fd, n)
    first, second = (device.encode(Readback(j * n, counts_of(j, n))) for j in range(2))
    at = data.draw(st.integers(0, len(first) - 1))
    how = data.draw(st.sampled_from(["drop", "cut", "long", "format", "moved"]))
    frame = first.pop(at)
    if how != "drop":
        index = ((int.from_bytes(frame.data[:2], "little") - 1) % 65536).to_bytes(2, "little")
        changed = {"cut": frame.data[:-1], "long": frame.data + b"\0", "moved": index + frame.data[2:]}
        first.insert(at, frame._replace(data=changed.get(how, frame.data), fd=fd != (how == "format")))
    order = data.draw(st.permutations(second))
    (got,) = blocks(host, [*first, *order, *order])
    assert got.first == n
    np.testing.assert_array_equal(got.counts, counts_of(1, n))
    assert host._counters["damaged_frames"] == (how != "drop")


@pytest.mark.parametrize("fd", [True, False])
def test_version_1_sends_and_understands_neither(fd: bool) -> None:
    device, host = ends(fd, 3)
    frames = [*host.encode(output(0, 3, 20 << 16)), *device.encode(Readback(0, counts_of(0, 3)))]
    for end in ends(fd, 3):
        end.speak(1)
        end.configure(Stream(4, 3, RATE_HZ, 16, 1))
        end.decode(next(frame for frame in frames if frame.identifier == 0x053))
        assert end.decode(next(frame for frame in frames if frame.identifier == 0x063)) is None
        assert end._counters["foreign_frames"] == 2
        if end._device:
            with refused(DaqRefused, "version"):
                end.encode(Readback(0, counts_of(0, 3)))
        else:
            assert not told(end.encode(output(0, 3, 20 << 16)))


def test_frames_of_ones_own_and_those_before_the_start_are_nothing() -> None:
    device, host = ends(True, 3)
    period, readback = host.encode(output(0, 3, 9 << 16))[1], device.encode(Readback(0, counts_of(0, 3)))[0]
    assert period.identifier == 0x053
    assert host.decode(period) is device.decode(readback) is None
    assert host._counters["own_frames"] == device._counters["own_frames"] == 1
    for device_end, frame in ((True, period), (False, readback)):
        fresh = CanCodec(protocol_of(4, True, 3), device_end, {})
        fresh.speak(2)
        assert fresh.decode(frame) is None
