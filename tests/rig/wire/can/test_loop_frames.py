"""A loop on the device over CAN FD: what goes into frames comes out again, or is lost as a whole; the bus's load is the sum."""

import zlib
from contextlib import ExitStack

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.errors import DaqRefused
from rig.wire.can.bus import PythonCanBus
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import BusTiming, Frame, frame_seconds
from rig.wire.can.link import CanLink, bus_load
from rig.wire.can.protocol import shape_of
from rig.wire.can.slcan import SlcanBus
from rig.wire.messages import ROW_BYTES, STATE_BYTES, Output, Record, Rows, State, Stream
from tests.firmware.events import protocol_of

N_CHANNELS, BLOCK, RATE_HZ = 3, 20, 1000.0
STREAM = Stream(N_CHANNELS, BLOCK, RATE_HZ, loop=True)


def ends(stream: Stream = STREAM) -> tuple[CanCodec, CanCodec, dict[str, int]]:
    """Device and host, speaking version 2, and what the host counts."""
    counters: dict[str, int] = {}
    device, host = (
        CanCodec(protocol_of(stream.n_channels, True, 3), end, counts)
        for end, counts in ((True, {}), (False, counters))
    )
    for end in (device, host):
        end.speak(2)
        end.configure(stream)
    return device, host, counters


def block_of(number: int) -> Rows:
    rng = np.random.default_rng(number)
    readings = rng.standard_normal((BLOCK, N_CHANNELS)).astype(np.float32)
    return Rows(number * BLOCK, readings, rng.integers(0, 256, (BLOCK, ROW_BYTES), np.uint8), 1, 2, 3, number)


def state_of(number: int, size: int = 200) -> State:
    return State(number * BLOCK, (Record(7, 0, bytes([number % 256]) * size), Record(9, 40, b"1234")))


def decoded(end: CanCodec, frames: list[Frame]) -> list:
    return [message for frame in frames if (message := end.decode(frame)) is not None]


def require_block(found: Rows, wanted: Rows) -> None:
    assert found.readings.tobytes() == wanted.readings.tobytes()
    assert found.rows.tobytes() == wanted.rows.tobytes()
    assert (found.first, *found[3:]) == (wanted.first, *wanted[3:])


@given(st.binary(min_size=1, max_size=512), st.integers(0, 15), st.integers(0, 2**31))
def test_pieces_of_the_records_come_in_frames_that_stand_alone(data, array, offset):
    device, host, _ = ends()
    frames = host.encode(Record(array, offset, data))
    got = sorted(decoded(device, frames[::-1]), key=lambda one: one.offset)
    assert {one.array for one in got} == {array}
    assert got[0].offset == offset
    assert b"".join(one.data for one in got) == data
    assert {frame.identifier for frame in frames} == {0x073}


@pytest.mark.parametrize("size", [1, 30, 31, 32, 500, 1000])
def test_states_and_rows_come_out_as_they_went_in(size):
    device, host, counters = ends()
    for number in range(70):  # beyond the numbers of messages
        wanted = state_of(number, size)
        frames = device.encode(wanted) + device.encode(block_of(number))
        state, rows = decoded(host, frames)
        assert state == wanted
        require_block(rows, block_of(number))
        assert {len(frame.data) for frame in frames} <= {8, 12, 16, 20, 24, 32, 48, 64}
    assert not any(counters.values())


def test_a_message_is_its_length_its_payload_and_the_payloads_crc_in_frames_of_62_bytes():
    device, _, _ = ends()
    frames = device.encode(block_of(0))
    assert [int.from_bytes(frame.data[:2], "little") for frame in frames] == [*range(len(frames))]
    data = b"".join(frame.data[2:] for frame in frames)
    size = int.from_bytes(data[:4], "little")
    assert size == 28 + BLOCK * (4 * N_CHANNELS + ROW_BYTES)
    assert data[4 + size : 8 + size] == zlib.crc32(data[4 : 4 + size]).to_bytes(4, "little")
    assert not any(data[8 + size :])
    assert int.from_bytes(device.encode(block_of(1))[1].data[:2], "little") == 2048 + 1


@settings(max_examples=60)
@given(st.data())
def test_frames_that_change_places_or_come_twice_do_no_harm_and_a_lost_one_loses_its_message_alone(data):
    device, host, counters = ends()
    frames = [frame for number in range(12) for frame in device.encode(block_of(number))]
    of_a_block = len(frames) // 12
    lost = data.draw(st.sets(st.integers(0, len(frames) - 1), max_size=3))
    twice = data.draw(st.sets(st.integers(0, len(frames) - 1), max_size=5)) - lost
    sent = [frame for i, frame in enumerate(frames) if i not in lost for _ in range(2 if i in twice else 1)]
    for i in data.draw(st.sets(st.integers(0, len(sent) // 2 - 1), max_size=8)):
        sent[2 * i], sent[2 * i + 1] = sent[2 * i + 1], sent[2 * i]
    found = {rows.first // BLOCK: rows for rows in decoded(host, sent)}
    assert set(found) == set(range(12)) - {i // of_a_block for i in lost}
    for number, rows in found.items():
        require_block(rows, block_of(number))
    assert counters["crc_errors"] == 0


def test_a_digit_that_changes_behind_the_bus_spoils_the_block_and_is_counted():
    device, host, counters = ends()
    frames = device.encode(block_of(0))
    frames[3] = frames[3]._replace(data=frames[3].data[:10] + b"?" + frames[3].data[11:])
    assert decoded(host, frames) == []
    assert counters["crc_errors"] == 1
    (rows,) = decoded(host, device.encode(block_of(1)))
    require_block(rows, block_of(1))


def test_messages_whose_ends_never_come_are_given_up_and_numbers_begin_anew():
    device, host, counters = ends()
    for number in range(100):
        decoded(host, device.encode(block_of(number))[:-1])
    assert counters["incomplete_blocks"] > 90
    (rows,) = decoded(host, device.encode(block_of(100)))
    require_block(rows, block_of(100))


def test_frames_that_are_none_are_damaged():
    _, host, counters = ends()
    for frame in (Frame(0x093, b"\0", True), Frame(0x083, bytes(8)), Frame(0x073, bytes(64), True)):
        assert host.decode(frame) is None
    assert counters["damaged_frames"] == 3


def test_without_rows_in_its_frames_a_bus_says_so():
    classical = CanCodec(protocol_of(4, False, 1), False, {})
    with pytest.raises(DaqRefused, match="no frames for a loop"):
        classical.encode(Record(0, 0, b"1"))
    link = CanLink(SlcanBus("/dev/null"), 4, BusTiming(fd=False))
    assert "5000 Hz x 48 bytes = 1.92 Mbit/s" in link.why_no_rows(Stream(4, 100, 5000.0, loop=True))
    assert CanLink(SlcanBus("/dev/null"), 4, BusTiming(fd=True)).why_no_rows(STREAM) == ""


def test_over_a_backend_of_python_can_rows_states_and_records_arrive(request):
    timing = BusTiming(fd=True)
    host, device = (
        CanLink(PythonCanBus("virtual", request.node.name, timing), N_CHANNELS, timing, 3, device=end)
        for end in (False, True)
    )
    with ExitStack() as held:
        for end in (host, device):
            end.open()
            held.callback(end.close)
            end.speak(2)
            end.configure(STREAM)
        host.send(Record(5, 1000, bytes(range(100))))
        pieces = [device.receive(1.0), device.receive(1.0)]
        assert b"".join(piece.data for piece in pieces) == bytes(range(100))
        assert [(piece.array, piece.offset) for piece in pieces] == [(5, 1000), (5, 1056)]
        device.send(state_of(1))
        device.send(block_of(1))
        assert host.receive(1.0) == state_of(1)
        require_block(host.receive(1.0), block_of(1))


def test_outputs_are_no_part_of_such_a_stream():
    _, host, _ = ends()
    with pytest.raises(DaqRefused):
        host.encode(Output(0, np.zeros(BLOCK, np.int16)))


def test_the_load_of_the_bus_is_the_sum_of_its_frames():
    stream = Stream(4, 100, 5000.0, loop=True, state_blocks=5)
    rows, state = 28 + 100 * 48 + 8, STATE_BYTES + 8
    assert (rows, state % 62) == (78 * 62, 48)
    of_rows, of_state = 78 * frame_seconds(64, True, 1e6, 5e6), 21 * frame_seconds(64, True, 1e6, 5e6)
    small = (10 + 20) * frame_seconds(8, False, 1e6)
    found = bus_load(shape_of(4, True), stream, 1e6, 5e6)
    assert found.share == pytest.approx(50 * of_rows + 12 * of_state + small, rel=1e-12)
    assert 0.70 < found.share < 0.72
    assert "rows" in found.sum_text
