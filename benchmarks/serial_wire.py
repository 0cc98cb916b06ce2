"""What the serial link costs, beside a bare echo of the same bytes: ``python -m benchmarks.serial_wire [--json]``.

Two processes and one pseudo-terminal. The host sends the outputs of a block and waits for the samples of a block, the other
process answers each with the other; 4 channels, 16 bits. *Link*: `SerialLink` at both ends. *Bare*: ``os.read`` and
``os.write`` of as many bytes in blocking mode, no frames. Rounds alternate, so that what else the machine does falls on
both alike, and the ratios are medians of the rounds. CPU is what both processes used, by ``getrusage``. *Streamed*: samples
one way as fast as the line takes them, frames a second, likewise.
"""

import json
import multiprocessing as mp
import os
import resource
import statistics
import sys
import time
import tty
from collections.abc import Callable
from multiprocessing.connection import Connection

import numpy as np

from rig.wire.messages import EmergencyStop, Output, Samples, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import frame
from rig.wire.serial.link import SerialLink
from rig.wire.serial.pty import open_pseudo_terminal

BLOCKS = (1, 5, 10)
N_CHANNELS = 4
ROUNDS = 7
FRAMES = 4000  # a round
STREAMED = 10_000
PATIENCE_S = 5.0
Ends = tuple[int, str]  # near descriptor and port of a line


def messages(block: int) -> tuple[Samples, Output]:
    """Blocks of a middling sine in all channels."""
    sine = (8000 * np.sin(np.arange(block * N_CHANNELS))).astype(np.int16)
    return Samples(123_456, sine.reshape(block, N_CHANNELS), 0, 0, 987_654_321, 77), Output(123_456, sine[:block], 77)


def frame_sizes(block: int) -> tuple[int, int]:
    """Bytes on the line of a block of samples and of outputs."""
    codec = Codec()
    codec.configure(Stream(N_CHANNELS, block, 1000.0))
    samples, output = (len(frame(codec.encode(message))) for message in messages(block))
    return samples, output


def _link(ends: Ends, block: int, near: bool) -> SerialLink:
    descriptor, path = ends
    link = SerialLink.on(descriptor, "near", patience_s=PATIENCE_S) if near else SerialLink.port(path, 3_000_000)
    link.open()
    link.configure(Stream(N_CHANNELS, block, 1000.0))
    return link


def link_device(ends: Ends, block: int) -> None:
    """Answer outputs with samples, then stream samples."""
    link, (samples, _) = _link(ends, block, near=True), messages(block)
    for _ in range(FRAMES):
        assert isinstance(link.receive(PATIENCE_S), Output)
        link.send(samples)
    assert isinstance(link.receive(PATIENCE_S), EmergencyStop)  # the host is ready
    for _ in range(STREAMED):
        link.send(samples)
    link.receive(PATIENCE_S)


def link_host(ends: Ends, block: int, times: list[float]) -> float:
    """Round trips in seconds; returns the seconds that the streamed frames took."""
    link, (_, output) = _link(ends, block, near=False), messages(block)
    for _ in range(FRAMES):
        start = time.perf_counter()
        link.send(output)
        assert isinstance(link.receive(PATIENCE_S), Samples)
        times.append(time.perf_counter() - start)
    link.send(EmergencyStop())
    start = time.perf_counter()
    for _ in range(STREAMED):
        assert isinstance(link.receive(PATIENCE_S), Samples)
    streamed_s = time.perf_counter() - start
    link.send(EmergencyStop())
    assert not any(link.counters.values()), link.counters
    link.close()
    return streamed_s


def _read(descriptor: int, size: int) -> None:
    while size > 0:
        size -= len(os.read(descriptor, min(size, 4096)))


def bare_device(ends: Ends, block: int) -> None:
    """As `link_device`, in bytes."""
    descriptor, (samples, output) = ends[0], frame_sizes(block)
    os.set_blocking(descriptor, True)
    data = bytes(samples)
    for _ in range(FRAMES):
        _read(descriptor, output)
        os.write(descriptor, data)
    _read(descriptor, 1)
    for _ in range(STREAMED):
        os.write(descriptor, data)
    _read(descriptor, 1)


def bare_host(ends: Ends, block: int, times: list[float]) -> float:
    """As `link_host`, in bytes."""
    samples, output = frame_sizes(block)
    descriptor = os.open(ends[1], os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)  # VMIN = 1
    data = bytes(output)
    for _ in range(FRAMES):
        start = time.perf_counter()
        os.write(descriptor, data)
        _read(descriptor, samples)
        times.append(time.perf_counter() - start)
    os.write(descriptor, b"\1")
    start = time.perf_counter()
    _read(descriptor, STREAMED * samples)
    streamed_s = time.perf_counter() - start
    os.write(descriptor, b"\1")
    os.close(descriptor)
    return streamed_s


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _serve(device: Callable[[Ends, int], None], ends: Ends, block: int, pipe: Connection) -> None:
    start = _cpu_s()
    device(ends, block)
    pipe.send(_cpu_s() - start)


def one_round(bare: bool, block: int) -> dict[str, float]:
    """Frames a second, CPU of both ends per frame, round trips in us."""
    line = open_pseudo_terminal()
    ends = line.descriptor, line.path
    near, far = mp.Pipe()
    device = mp.get_context("fork").Process(
        target=_serve, args=(bare_device if bare else link_device, ends, block, far)
    )
    device.start()
    times: list[float] = []
    start = _cpu_s()
    streamed_s = (bare_host if bare else link_host)(ends, block, times)
    cpu_s = _cpu_s() - start + near.recv()
    device.join()
    line.close()
    assert device.exitcode == 0
    return {
        "frames_per_s": 2 * FRAMES / sum(times),
        "streamed_per_s": STREAMED / streamed_s,
        "cpu_us_per_frame": 1e6 * cpu_s / (2 * FRAMES + STREAMED),
        "round_trip_p50_us": 1e6 * float(np.percentile(times, 50)),
        "round_trip_p99_us": 1e6 * float(np.percentile(times, 99)),
    }


def measure() -> dict[str, dict[str, float]]:
    """All numbers by block size."""
    out = {}
    for block in BLOCKS:
        rounds = {bare: list[dict[str, float]]() for bare in (True, False)}
        for _ in range(ROUNDS):
            for bare, results in rounds.items():
                results.append(one_round(bare, block))
        values = {f"bare_{key}": statistics.median(each[key] for each in rounds[True]) for key in rounds[True][0]}
        values |= {f"link_{key}": statistics.median(each[key] for each in rounds[False]) for key in rounds[False][0]}
        for key in rounds[True][0]:
            pairs = zip(rounds[False], rounds[True], strict=True)
            values[f"ratio_{key}"] = statistics.median(link[key] / bare[key] for link, bare in pairs)
        out[f"n = {block}, {sum(frame_sizes(block))} bytes there and back"] = values
    return out


if __name__ == "__main__":
    results = measure()
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, values in results.items():
            print(name)
            for key, value in values.items():
                print(f"  {key:28} {value:12.2f}")
