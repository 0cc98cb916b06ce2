"""Streams of frames that were damaged on the way: what is intact comes through, nothing else does, memory stays bounded."""

import random
import tracemalloc
from itertools import pairwise

import pytest
from hypothesis import given, settings, strategies as st

from rig.wire.loop_payloads import LARGEST_PAYLOAD
from rig.wire.messages import VERSION, Request, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame, largest_frame, payload_of as product_payload_of
from tests.docs.wire import on_the_line, payload_of
from tests.rig.wire.serial.strategies import messages, same

STREAM = Stream(n_channels=3, block=4, rate_hz=1000.0)
PING = Request(1, 1, 65)


def reader(stream=STREAM):
    codec = Codec()
    codec.version = VERSION
    codec.configure(stream)
    out = FrameReader(codec, {})
    out.configure(stream)
    return codec, out


def fed(data, cuts=()):
    """Messages and counters of bytes that come in pieces."""
    counters = {}
    codec, _ = reader()
    decoder = FrameReader(codec, counters)
    decoder.configure(STREAM)
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    got = [message for a, b in pairwise(edges) for message in decoder.feed(data[a:b])]
    return got, counters


def mutated(data, kind, where, amount):
    where %= len(data) + 1
    match kind:
        case "flip" if where < len(data):
            return data[:where] + bytes([data[where] ^ 1 << amount % 8]) + data[where + 1 :]
        case "cut":
            return data[:where] + data[where + amount :]
        case "repeat":
            return data[: where + amount] + data[where:]
        case "garbage":
            return data[:where] + random.Random(amount).randbytes(amount) + data[where:]
    return data


mutations = st.tuples(st.sampled_from(["flip", "cut", "repeat", "garbage"]), st.integers(0, 10**6), st.integers(1, 60))


@given(
    st.lists(messages(STREAM, VERSION), min_size=1, max_size=12),
    st.lists(mutations, max_size=8),
    st.lists(st.integers(0, 10**6)),
)
def test_of_a_damaged_stream_all_that_is_intact_comes_through_and_nothing_else(sent, changes, cuts):
    codec, _ = reader()
    payloads = {codec.encode(message): message for message in sent}
    data = b"".join(frame(payload) for payload in payloads)
    for change in changes:
        data = mutated(data, *change)
    arrived = [payload for piece in data.split(b"\0")[:-1] if (payload := payload_of(piece)) is not None]
    got, counters = fed(data, cuts)
    assert len(got) == len(arrived)
    assert all(same(message, payloads[payload]) for message, payload in zip(got, arrived, strict=True))
    assert changes or not any(counters.values())


@given(
    st.binary(max_size=600),
    st.lists(messages(STREAM, VERSION), min_size=1, max_size=4),
    st.lists(st.integers(0, 10**6)),
)
def test_frames_behind_garbage_come_through_from_the_next_zero_on(garbage, sent, cuts):
    codec, _ = reader()
    got, counters = fed(garbage + b"\0" + b"".join(frame(codec.encode(message)) for message in sent), cuts)
    assert all(same(a, b) for a, b in zip(got, sent, strict=True))
    assert counters["garbage_bytes"] == len(garbage.replace(b"\0", b""))


@given(st.binary(max_size=400))
def test_frames_are_those_of_the_page(payload):
    assert frame(payload) == on_the_line(payload)
    assert len(frame(payload)) <= largest_frame(len(payload))


def test_runs_longer_than_a_block_are_framed_as_the_page_says():
    for size in (249, 250, 251, 504, 1000):
        payload = bytes([7]) * size
        assert payload_of(frame(payload)[:-1]) == payload == payload_of(on_the_line(payload)[:-1])
        assert len(frame(payload)) <= largest_frame(size)


def test_an_empty_piece_behind_one_of_254_bytes_changes_nothing():
    payloads = (bytes([byte]) * 250 for byte in range(1, 256))
    payload, encoded = next((one, code) for one in payloads if (code := frame(one)[:-1])[0] == 255)
    assert len(encoded) == 255
    assert product_payload_of(encoded + b"\1") == product_payload_of(encoded) == payload


def test_what_is_skipped_is_counted_by_its_reason():
    codec, _ = reader()
    good = codec.encode(PING)
    damaged = bytearray(frame(good))
    damaged[5] ^= 0x10
    foreign = frame(b"\x09\x05" + bytes(14))
    unknown = frame(b"\x02\x63" + bytes(10))
    got, counters = fed(bytes(damaged) + foreign + unknown + b"\x05" * 3000 + b"\0" + frame(good))
    assert got == [PING]
    assert counters == {
        "crc_errors": 1,
        "foreign_versions": 1,
        "malformed": 1,
        "oversize_frames": 1,
        "garbage_bytes": len(damaged) - 1 + len(foreign) - 1 + len(unknown) - 1 + 3000,
    }


def test_a_zero_that_became_something_else_costs_its_two_neighbours_only():
    codec, _ = reader()
    frames = [frame(codec.encode(PING._replace(number=number))) for number in range(4)]
    frames[1] = frames[1][:-1] + b"\x01"
    got, counters = fed(b"".join(frames))
    assert [message.number for message in got] == [0, 3]
    assert counters["crc_errors"] == 1


def test_the_two_halves_of_a_frame_are_no_frames():
    codec, _ = reader()
    whole = frame(codec.encode(PING))
    assert fed(whole[: len(whole) // 2] + b"\0" + whole[len(whole) // 2 :])[0] == []


@pytest.mark.parametrize("piece", [1, 4096])
def test_memory_stays_bounded_whatever_comes(piece):
    codec, _ = reader()
    counters = {}
    decoder = FrameReader(codec, counters)
    garbage = b"\xff" * piece
    rounds = 2_000_000 // piece if piece > 1 else 100_000
    tracemalloc.start()
    try:
        for _ in range(rounds):
            assert decoder.feed(garbage) == []
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 6 * LARGEST_PAYLOAD
    assert counters["oversize_frames"] == 1
    assert decoder.feed(b"\0" + frame(codec.encode(PING))) == [PING]
    assert counters["garbage_bytes"] == rounds * piece


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_noise_never_is_a_message(seed):
    assert fed(random.Random(seed).randbytes(20_000))[0] == []
