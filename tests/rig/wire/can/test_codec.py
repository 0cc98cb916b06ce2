"""Frames to messages and back, and what becomes of streams that are dropped, doubled, swapped, cut, flipped or foreign."""

from collections.abc import Iterator
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.errors import DaqMismatch, DaqRefused
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame
from rig.wire.can.protocol import protocol
from rig.wire.messages import Answer, DeviceState, EmergencyStop, Heartbeat, Output, Request, Samples, Stream
from tests.refused import refused

BUSES = [(4, True, 1), (4, True, 10), (4, False, 1), (4, False, 5), (9, False, 3), (40, True, 7), (2, True, 33)]
BEAT = Heartbeat(int(DeviceState.ARMED), 0, 7, 0)


defined = cache(protocol)


def ends(n_channels: int, fd: bool, block: int, queue: int = 1, node: int = 3) -> tuple[CanCodec, CanCodec]:
    """Device and host, configured, the device's first heartbeat sent."""
    both = [CanCodec(defined(n_channels, fd, node), device, {}) for device in (True, False)]
    for end in both:
        end.configure(Stream(n_channels, block, 1000.0, 16, queue))
    both[0].encode(BEAT)
    return both[0], both[1]


@lru_cache(maxsize=10_000)
def block_of(j: int, n: int, n_channels: int) -> np.ndarray:
    """Counts that name their block, row and channel, not to be written to."""
    counts = np.random.default_rng(j).integers(-32768, 32768, (n, n_channels)).astype(np.int16)
    counts.flags.writeable = False
    return counts


def sent(device: CanCodec, blocks: Iterator[int] | range, n: int, n_channels: int) -> list[list[Frame]]:
    return [device.encode(Samples(j * n, block_of(j, n, n_channels))) for j in blocks]


def received(host: CanCodec, frames: list[Frame]) -> list[Samples]:
    return [message for frame in frames if isinstance(message := host.decode(frame), Samples)]


def flat(blocks: list[list[Frame]]) -> list[Frame]:
    return [frame for block in blocks for frame in block]


@pytest.mark.parametrize(("n_channels", "fd", "n"), BUSES)
def test_streams_arrive_as_they_were_sent_far_beyond_the_wrap(n_channels: int, fd: bool, n: int) -> None:
    device, host = ends(n_channels, fd, n, queue=2)
    for j in range(600):
        flags = j % 3
        (got,) = received(host, device.encode(Samples(j * n, block_of(j, n, n_channels), flags, dropped=5)))
        assert (got.first, got.flags) == (j * n, flags)
        np.testing.assert_array_equal(got.counts, block_of(j, n, n_channels))
        volts = block_of(j, n, 1)[:, 0]
        (output,) = filter(None, map(device.decode, host.encode(Output((j + 2) * n, volts))))
        assert isinstance(output, Output)
        assert output.first == (j + 2) * n
        np.testing.assert_array_equal(output.counts, volts)
    assert not any(device._counters.values()) and not any(host._counters.values())  # noqa: PT018


@settings(max_examples=50)
@given(*[st.integers(0, 255)] * 4, st.integers(0, 2**32 - 1))
def test_commands_arrive_as_they_were_sent(number: int, command: int, parameter: int, item: int, value: int) -> None:
    device, host = ends(4, True, 1)
    request, answer = Request(number, command, parameter, item, value), Answer(number, command, parameter, item, value)
    assert [device.decode(frame) for frame in host.encode(request)] == [request]
    assert [host.decode(frame) for frame in device.encode(answer)] == [answer]
    beat = Heartbeat(number, command, parameter, value, item)
    assert [host.decode(frame) for frame in device.encode(beat)] == [beat]
    assert [device.decode(frame) for frame in host.encode(EmergencyStop(item))] == [EmergencyStop(item)]


def test_an_emergency_stop_is_for_all_nodes_and_needs_no_data() -> None:
    for node in (0, 3, 15):
        device, _ = ends(4, False, 1, node=node)
        assert device.decode(Frame(0x000, b"")) == EmergencyStop(0)
        assert device.decode(Frame(0x000, b"\x05garbage")) == EmergencyStop(5)


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(BUSES), st.data())
def test_every_block_whose_frames_all_come_is_recovered_and_no_other(
    bus: tuple[int, bool, int], data: st.DataObject
) -> None:
    n_channels, fd, n = bus
    device, host = ends(n_channels, fd, n)
    blocks = sent(device, range(60), n, n_channels)
    dropped = data.draw(st.sets(st.tuples(st.integers(0, 59), st.integers(0, 50)), max_size=12))
    doubled = data.draw(st.sets(st.tuples(st.integers(0, 59), st.integers(0, 50)), max_size=12))
    frames, whole = [], []
    for j, block in enumerate(blocks):
        keep = [index for index in range(len(block)) if (j, index) not in dropped]
        beats = {index for index, frame in enumerate(block) if frame.identifier < 0x300}
        if len(set(range(len(block))) - beats - set(keep)) == 0:
            whole.append(j)
        for index in keep:
            frames += [block[index]] * (2 if (j, index) in doubled else 1)
    got = received(host, frames)
    assert [samples.first for samples in got] == [j * n for j in whole]
    for samples, j in zip(got, whole, strict=True):
        np.testing.assert_array_equal(samples.counts, block_of(j, n, n_channels))


@settings(deadline=None, max_examples=30)
@given(st.sampled_from([bus for bus in BUSES if bus[2] > 1]), st.randoms(use_true_random=False))
def test_frames_that_change_places_within_a_block_and_with_the_next_cost_nothing(
    bus: tuple[int, bool, int], random: object
) -> None:
    n_channels, fd, n = bus
    device, host = ends(n_channels, fd, n)
    device._reported = 1 << 30  # no heartbeats in between
    blocks = sent(device, range(40), n, n_channels)
    for block in blocks:
        random.shuffle(block)  # type: ignore[attr-defined]
    for earlier, later in pairwise(blocks):
        if len(earlier) > 1 and len(later) > 1:
            earlier[-1], later[0] = later[0], earlier[-1]
    got = received(host, flat(blocks))
    assert [samples.first for samples in got] == [j * n for j in range(40)]
    for j, samples in enumerate(got):
        np.testing.assert_array_equal(samples.counts, block_of(j, n, n_channels))


def mutated(frames: list[Frame], data: st.DataObject) -> list[Frame]:
    """Up to twenty frames cut, lengthened, flipped, of others, remote from here, or in another place."""
    out = list(frames)
    for _ in range(data.draw(st.integers(0, 20))):
        at = data.draw(st.integers(0, len(out) - 1))
        frame = out[at]
        kind = data.draw(
            st.sampled_from(["cut", "long", "data", "identifier", "foreign", "extended", "format", "move", "drop"])
        )
        bit = data.draw(st.integers(0, 10))
        if kind == "cut":
            frame = frame._replace(data=frame.data[: bit % (len(frame.data) + 1)])
        elif kind == "long":
            frame = frame._replace(data=frame.data + bytes(bit))
        elif kind == "data" and frame.data:
            changed = bytearray(frame.data)
            changed[bit % len(changed)] ^= 1 << bit % 8
            frame = frame._replace(data=bytes(changed))
        elif kind == "identifier":
            frame = frame._replace(identifier=frame.identifier ^ 1 << bit)
        elif kind == "foreign":
            frame = Frame(data.draw(st.integers(0, 0x7FF)), data.draw(st.binary(max_size=64)), bit % 2 == 0)
        elif kind == "extended":
            frame = frame._replace(extended=True)
        elif kind == "format":
            frame = frame._replace(fd=not frame.fd)
        elif kind == "move":
            out.insert(data.draw(st.integers(0, len(out) - 1)), out.pop(at))
            continue
        elif len(out) > 1:
            del out[at]
            continue
        out[at] = frame
    return out


@settings(deadline=None, max_examples=100)
@given(st.sampled_from(BUSES), st.booleans(), st.data())
def test_whatever_comes_nothing_breaks_and_memory_stays_bounded(
    bus: tuple[int, bool, int], samples: bool, data: st.DataObject
) -> None:
    n_channels, fd, n = bus
    device, host = ends(n_channels, fd, n)
    if samples:
        frames, end = flat(sent(device, range(40), n, n_channels)), host
    else:
        frames = flat([host.encode(Output((j + 1) * n, block_of(j, n, 1)[:, 0])) for j in range(40)])
        end = device
    for frame in mutated(frames, data):
        message = end.decode(frame)
        if isinstance(message, Samples | Output):
            assert message.counts.shape == ((n, n_channels) if samples else (n,))
            assert message.first % n == 0
        held = sum(block.counts.nbytes + len(block.seen) for block in end._incoming._open.values())
        assert held <= 4 * (2 * n * n_channels + 256)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(BUSES), st.data())
def test_frames_of_wrong_length_or_format_are_never_taken_for_good_ones(
    bus: tuple[int, bool, int], data: st.DataObject
) -> None:
    n_channels, fd, n = bus
    device, host = ends(n_channels, fd, n)
    blocks = sent(device, range(30), n, n_channels)
    spoilt = data.draw(st.sets(st.integers(0, 29), min_size=1, max_size=8))
    for j in spoilt:
        at = data.draw(st.integers(0, len(blocks[j]) - 1))
        frame = blocks[j][at]
        if frame.identifier < 0x300:
            continue
        how = data.draw(st.sampled_from(["cut", "long", "format", "extended"]))
        if how == "cut":
            frame = frame._replace(data=frame.data[: data.draw(st.integers(0, len(frame.data) - 1))])
        else:
            frame = {
                "long": frame._replace(data=frame.data + b"\0"),
                "format": frame._replace(fd=not frame.fd),
                "extended": frame._replace(extended=True),
            }[how]
        blocks[j][at] = frame
    got = received(host, flat(blocks))
    for samples in got:
        np.testing.assert_array_equal(samples.counts, block_of(samples.first // n, n, n_channels))
    assert {samples.first // n for samples in got} >= set(range(30)) - spoilt


@pytest.mark.parametrize(("n_channels", "fd", "n"), BUSES)
def test_a_loss_longer_than_the_wrap_is_put_right_by_the_next_heartbeat(n_channels: int, fd: bool, n: int) -> None:
    device, host = ends(n_channels, fd, n)
    shape = host.protocol.shape
    groups = -(-n // shape.rows)
    wrap = shape.wrap // groups  # in blocks
    blocks = sent(device, range(5 * wrap), n, n_channels)
    lost = range(wrap // 3, 3 * wrap + 1)
    got = received(host, flat([block for j, block in enumerate(blocks) if j not in lost]))
    true = {block_of(j, n, n_channels).tobytes(): j for j in range(5 * wrap)}
    wrong = [samples for samples in got if true[samples.counts.tobytes()] * n != samples.first]
    assert len(wrong) * groups <= shape.wrap // 2  # the bound that the page states
    assert got[-1].first == (5 * wrap - 1) * n
    assert [samples.first for samples in got] == sorted(samples.first for samples in got)
    assert host._counters["resynchronised"] == 1


def test_two_frames_that_contradict_each_other_spoil_their_block() -> None:
    device, host = ends(4, True, 10)
    first, second = (frame for frame in sent(device, range(1), 10, 4)[0] if frame.identifier >= 0x300)
    other = first._replace(data=first.data[:2] + b"\x55" * 56 + first.data[58:])
    assert received(host, [first, other, second]) == []
    assert len(received(host, flat(sent(device, range(1, 3), 10, 4)))) == 2


def test_what_frames_cannot_carry_is_refused() -> None:
    device, _ = ends(4, False, 1)
    for stream, error, said in (
        (Stream(4, 33, 100.0), DaqRefused, {"field": "block", "value": 33}),
        (Stream(4, 1, 100.0, 32), DaqRefused, {"says": "counts-of-bits-allowed-over-can"}),
        (Stream(5, 1, 100.0), DaqMismatch, {"says": "channels-but-the-bus-is-defined"}),
    ):
        with refused(error, **said):
            device.configure(stream)
    with refused(DaqRefused, "before-the-stream-is-configured"):
        CanCodec(protocol(4, True, 1), True, {}).encode(Samples(0, np.zeros((1, 4), np.int16)))


def test_stream_frames_before_the_stream_is_agreed_on_are_none() -> None:
    device, _ = ends(4, True, 1)
    host = CanCodec(protocol(4, True, 3), False, {})
    assert received(host, flat(sent(device, range(3), 1, 4))) == []
    assert host._counters["foreign_frames"] == 3


def test_frames_of_ones_own_that_a_bus_returns_are_counted_apart() -> None:
    device, host = ends(4, True, 1)
    for frame in host.encode(Request(1, 1)) + host.encode(Output(1, np.zeros(1, np.int16))):
        assert host.decode(frame) is None
    assert host._counters["own_frames"] == 3  # with the index of the first output
    assert host._counters["foreign_frames"] == 0
    assert device.decode(device.encode(Answer(1, 0))[0]) is None


@pytest.mark.parametrize(("n_channels", "fd", "n"), BUSES)
def test_a_loss_is_put_right_where_the_index_of_32_bits_begins_anew(n_channels: int, fd: bool, n: int) -> None:
    device, host = ends(n_channels, fd, n)
    shape = host.protocol.shape
    wrap = shape.wrap // -(-n // shape.rows)  # in blocks
    start = (1 << 32) // n - wrap
    host._incoming.begin(start)
    numbers = range(start, start + 5 * wrap)
    blocks = sent(device, numbers, n, n_channels)
    kept = [*range(wrap // 3), *range(3 * wrap + 1, 5 * wrap)]
    got = received(host, flat([blocks[k] for k in kept]))
    assert [samples.first for samples in got[: wrap // 3]] == [j * n for j in numbers[: wrap // 3]]
    assert got[-1].first == numbers[-1] * n > 1 << 32
    assert [samples.first for samples in got] == sorted(samples.first for samples in got)
    assert host._counters["resynchronised"] == 1
