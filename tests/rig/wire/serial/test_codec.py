"""Messages survive their way over the wire, and nothing else becomes a message."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from rig.errors import DaqRefused
from rig.wire.loop_payloads import Malformed
from rig.wire.messages import VERSION, EmergencyStop, Heartbeat, Output, Readback, Request, Samples, Stream
from rig.wire.serial.codec import Codec, ForeignVersion
from tests.refused import refused
from tests.rig.wire.serial.strategies import messages, same, streams

STREAM = Stream(n_channels=4, block=5, rate_hz=5000.0)


def configured(stream=STREAM, version=VERSION):
    codec = Codec()
    codec.version = version
    codec.configure(stream)
    return codec


VERSIONS = st.sampled_from([1, 2])


@given(st.data(), VERSIONS)
def test_every_message_comes_out_as_it_went_in(data, version):
    stream = data.draw(streams)
    message = data.draw(messages(stream, version))
    assert same(configured(stream, version).decode(configured(stream, version).encode(message)), message)


SIZES = (5, 12, 16, 22, 30, 68)  # of every type, with 5 x 4 counts
payloads = st.sampled_from(SIZES).flatmap(lambda size: st.binary(min_size=size, max_size=size)) | st.binary(
    max_size=120
)


@given(payloads, st.integers(0, 11), VERSIONS, st.booleans())
def test_any_bytes_are_a_message_or_malformed(payload, kind, version, loop):
    codec = configured(STREAM._replace(loop=loop), version)
    payload = payload[:1] + bytes([kind]) + payload[2:]
    try:
        message = codec.decode(payload)
    except Malformed:
        return
    assert same(codec.decode(codec.encode(message)), message)


@pytest.mark.parametrize("bits", [16, 32])
def test_counts_of_samples_can_be_used_where_they_are(bits):
    codec = configured(Stream(3, 2, 1000.0, bits))
    counts = np.arange(6, dtype=f"int{bits}").reshape(2, 3)
    got = codec.decode(codec.encode(Samples(2**40, counts))).counts
    assert got.flags.aligned
    assert got.dtype == counts.dtype


def test_blocks_of_another_shape_are_malformed_and_not_sent():
    other = configured(STREAM._replace(block=6))
    counts = np.zeros((6, 4), np.int16)
    for message in (Samples(0, counts), Output(0, counts[:, 0]), Readback(0, counts[:, 0])):
        with pytest.raises(Malformed):
            configured().decode(other.encode(message))
        with refused(DaqRefused, "of-shape"):
            configured().encode(message)


def test_blocks_are_neither_sent_nor_understood_before_their_shape_is_known():
    samples = Samples(0, np.zeros((5, 4), np.int16))
    with pytest.raises(Malformed):
        Codec().decode(configured().encode(samples))
    with refused(DaqRefused, "configure"):
        Codec().encode(samples)


def test_commands_are_understood_in_every_version_and_streams_in_ours_alone():
    def of_version(message, version):
        return bytes([version]) + configured().encode(message)[1:]

    for message in (Request(1, 2, 3, 4, 5), EmergencyStop(6)):
        assert configured().decode(of_version(message, 77)) == message
    output = Output(0, np.zeros(5, np.int16))
    for message, version in ((Heartbeat(0, 0, 1, 0), VERSION + 1), (Heartbeat(0, 0, 1, 0), 0), (output, 1)):
        with pytest.raises(ForeignVersion):
            configured().decode(of_version(message, version))


@pytest.mark.parametrize("version", [1, 2])
def test_heartbeats_are_understood_in_every_version_that_is_spoken(version):
    beat = Heartbeat(2, 4, 7, 1002, 3)
    assert configured(version=3 - version).decode(configured(version=version).encode(beat)) == beat


def test_version_1_has_no_periods_and_no_readbacks():
    counts = np.arange(5, dtype=np.int16)
    assert configured(version=1).encode(Output(7, counts, 1, 1 << 20, 99)) == bytes.fromhex(
        "01040100070000000000000000000100020003000400"
    )
    with refused(DaqRefused, "version"):
        configured(version=1).encode(Readback(7, counts))
    with pytest.raises(Malformed):
        configured(version=1).decode(b"\1" + configured().encode(Readback(7, counts))[1:])
    with pytest.raises(Malformed):
        Codec().decode(b"\1\7\0\0")


def test_streams_that_no_frame_holds_are_refused():
    with refused(DaqRefused, "bytes-allowed-is"):
        Codec().configure(Stream(n_channels=8, block=5000, rate_hz=1e4))
    with refused(DaqRefused, "bits-allowed-is-or"):
        Codec().configure(Stream(n_channels=8, block=5, rate_hz=1e4, bits=24))


def test_what_is_counted_without_end_stays_in_its_field():
    samples = Samples(2**63, np.zeros((5, 4), np.int16), dropped=2**40, sequence=2**16 + 3)
    got = configured().decode(configured().encode(samples))
    assert (got.first, got.dropped, got.sequence) == (2**63, 2**32 - 1, 3)
