"""Bus load against the documents' numbers and against bits counted one by one."""

import numpy as np
import pytest

from rig.wire.can.blocks import pieces_of
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import frame_seconds
from rig.wire.can.link import bus_load, traffic
from rig.wire.can.protocol import protocol, shape_of
from rig.wire.messages import Heartbeat, Output, Readback, Samples, Stream


def stuffed(bits: str) -> int:
    """Length of a bit sequence once it is stuffed: after five alike the other one."""
    count, run, last = 0, 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        count += 1
        if run == 5:
            count, run, last = count + 1, 1, "10"[int(bit)]
    return count


@pytest.mark.parametrize("n_bytes", range(9))
def test_no_classical_frame_can_be_longer_than_the_worst_case(n_bytes: int) -> None:
    length = 34 + 8 * n_bytes
    worst = "11111" + "00001111" * 20  # five alike, then four of each: one stuff bit in four
    assert stuffed(worst[:length]) + 13 == pytest.approx(frame_seconds(n_bytes, False, 1.0))


@pytest.mark.parametrize(("rate_hz", "share"), [(1000.0, 0.21), (5000.0, 1.05)])
def test_four_channels_and_an_output_load_classical_can_as_documented(rate_hz: float, share: float) -> None:
    parts = traffic(shape_of(4, False), Stream(4, 1, rate_hz), 1e6, 0.0, 1)
    assert sum(part.share for part in parts[:2]) == pytest.approx(share, abs=1e-12)
    assert sum(part.share for part in parts[2:]) < 0.1 * share  # heartbeats and indices


@pytest.mark.parametrize(
    ("data_bit_rate_hz", "shares"), [(2e6, (0.90, 0.50, 0.33)), (5e6, (0.57, 0.25, 0.16)), (8e6, (0.48, 0.19, 0.11))]
)
def test_can_fd_at_five_kilohertz_loads_the_bus_as_documented(
    data_bit_rate_hz: float, shares: tuple[float, ...]
) -> None:
    """1, 4 and 8 samples a frame; the eighth of four channels does not fit beside a header, which the documents pass over."""
    for samples, share in zip((1, 4, 8), shares, strict=True):
        lengths = (min(2 + 8 * samples, 64), 2 + 2 * samples)
        seconds = sum(frame_seconds(length, True, 1e6, data_bit_rate_hz) for length in lengths)
        assert 5000.0 / samples * seconds == pytest.approx(share, abs=0.005 + 1e-9)


def test_the_frames_of_a_block_are_those_that_the_codec_sends() -> None:
    for n_channels, fd, block, outputs, lengths in (
        (4, True, 10, False, [64, 32]),
        (4, True, 10, True, [24]),
        (6, False, 2, False, [6, 6, 6, 6]),
        (4, False, 5, True, [8, 2]),
    ):
        pieces = pieces_of(shape_of(n_channels, fd), block, outputs)
        assert [piece.n_bytes for group in pieces for piece in group] == lengths


def test_the_sum_is_said() -> None:
    load = bus_load(shape_of(4, False), Stream(4, 1, 5000.0), 1e6, 0.0)
    assert load.share > 1.05
    assert "samples 5000/s x 135 us + outputs 5000/s x 75 us" in load.sum_text
    assert load.available_bit_s == 1e6


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    ("n_channels", "fd", "n"), [(4, True, 1), (4, True, 10), (4, False, 1), (4, False, 5), (9, False, 3)]
)
def test_the_sum_counts_the_frames_that_a_device_and_a_host_send(
    n_channels: int, fd: bool, n: int, version: int
) -> None:
    shape, stream = shape_of(n_channels, fd), Stream(n_channels, n, 1000.0)
    device, host = (CanCodec(protocol(n_channels, fd, 1), end, {}) for end in (True, False))
    for end in (device, host):
        end.speak(version)
        end.configure(stream)
    device.encode(Heartbeat(2, 0, 0, 0))
    frames = []
    for j in range(4000 // n):
        if version == 2 and j % 20 == 19:
            frames += device.encode(Readback(j * n, np.zeros(n, np.int16)))
        frames += device.encode(Samples(j * n, np.zeros((n, n_channels), np.int16)))
        frames += host.encode(Output((j + 1) * n, np.zeros(n, np.int16), 0, (7 << 16) + j))
    seconds = sum(frame_seconds(len(frame.data), frame.fd, 1e6, 2e6) for frame in frames) / 4.0
    beats = 10.0 * frame_seconds(8, False, 1e6)  # the device's own
    assert bus_load(shape, stream, 1e6, 2e6, version).share == pytest.approx(seconds + beats, rel=0.01)
