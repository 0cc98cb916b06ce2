"""What the serial link costs, beside a bare echo of the same bytes: ``python -m benchmarks.serial_wire [--json]``.

Two processes and one pseudo-terminal. The host sends the outputs of a block and waits for the samples of a block, the
device answers each with the other; 4 channels, 16 bits. *Bare*: ``os.read`` and ``os.write`` of as many bytes in blocking
mode, with no frames, no checks and no time-outs. *Link*: `SerialLink` at both ends. *Host*: `SerialLink` at the host's end,
where the driver is, and a bare device. CPU is what both processes used, by ``getrusage``. Rounds alternate, so that what
else the machine does falls on all alike; each number is the median of the rounds, each ratio the median of the ratios to
bare in the same round.
"""

import json
import multiprocessing as mp
import os
import resource
import statistics
import sys
import time
import tty
from multiprocessing.connection import Connection

import numpy as np

from rig.wire.messages import Output, Samples, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import frame
from rig.wire.serial.link import SerialLink
from rig.wire.serial.port import PseudoTerminal, open_pseudo_terminal

BLOCKS = (1, 5, 10)
KINDS = ("bare", "link", "host")
N_CHANNELS = 4
ROUNDS = 9
EXCHANGES = 5000  # a round
PATIENCE_S = 5.0
CHUNK = 4096


def messages(block: int) -> tuple[Samples, Output]:
    """Blocks of a middling sine in all channels."""
    sine = (8000 * np.sin(np.arange(block * N_CHANNELS))).astype(np.int16)
    return Samples(123_456, sine.reshape(block, N_CHANNELS), 0, 0, 987_654_321, 77), Output(123_456, sine[:block], 77)


def frames(block: int) -> tuple[bytes, bytes]:
    """What samples and outputs are on the line."""
    codec = Codec()
    codec.configure(Stream(N_CHANNELS, block, 1000.0))
    samples, output = (frame(codec.encode(message)) for message in messages(block))
    return samples, output


def link_device(line: PseudoTerminal, block: int) -> None:
    """Answer outputs with samples."""
    link = SerialLink.on(line.descriptor, "device", patience_s=PATIENCE_S)
    link.open()
    link.configure(Stream(N_CHANNELS, block, 1000.0))
    samples, _ = messages(block)
    for _ in range(EXCHANGES):
        assert isinstance(link.receive(PATIENCE_S), Output)
        link.send(samples)


def link_host(line: PseudoTerminal, block: int, times_s: np.ndarray) -> None:
    """Send outputs and wait for samples."""
    link = SerialLink.port(line.path, 3_000_000)
    link.open()
    link.configure(Stream(N_CHANNELS, block, 1000.0))
    _, output = messages(block)
    for index in range(EXCHANGES):
        start = time.perf_counter()
        link.send(output)
        assert isinstance(link.receive(PATIENCE_S), Samples)
        times_s[index] = time.perf_counter() - start
    assert not any(link.counters.values()), link.counters
    link.close()


def _read(descriptor: int, size: int) -> None:
    while size > 0:
        size -= len(os.read(descriptor, CHUNK))


def bare_device(line: PseudoTerminal, block: int) -> None:
    """As `link_device`, in bytes."""
    samples, output = frames(block)
    os.set_blocking(line.descriptor, True)
    for _ in range(EXCHANGES):
        _read(line.descriptor, len(output))
        os.write(line.descriptor, samples)


def bare_host(line: PseudoTerminal, block: int, times_s: np.ndarray) -> None:
    """As `link_host`, in bytes."""
    samples, output = frames(block)
    descriptor = os.open(line.path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)  # VMIN = 1
    for index in range(EXCHANGES):
        start = time.perf_counter()
        os.write(descriptor, output)
        _read(descriptor, len(samples))
        times_s[index] = time.perf_counter() - start
    os.close(descriptor)


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _serve(kind: str, line: PseudoTerminal, block: int, pipe: Connection) -> None:
    pipe.send(None)
    start = _cpu_s()
    (link_device if kind == "link" else bare_device)(line, block)
    pipe.send(_cpu_s() - start)


def one_round(kind: str, block: int) -> dict[str, float]:
    """Frames a second, CPU of both ends per frame, round trips in us."""
    line = open_pseudo_terminal()
    near, far = mp.Pipe()
    device = mp.get_context("fork").Process(target=_serve, args=(kind, line, block, far))
    device.start()
    near.recv()
    times_s = np.empty(EXCHANGES)
    start = _cpu_s()
    (bare_host if kind == "bare" else link_host)(line, block, times_s)
    cpu_s = _cpu_s() - start + near.recv()
    device.join()
    line.close()
    assert device.exitcode == 0
    return {
        "frames_per_s": 2 * EXCHANGES / float(times_s.sum()),
        "cpu_us_per_frame": 1e6 * cpu_s / (2 * EXCHANGES),
        "round_trip_p50_us": 1e6 * float(np.percentile(times_s, 50)),
        "round_trip_p99_us": 1e6 * float(np.percentile(times_s, 99)),
    }


def measure() -> dict[str, dict[str, float]]:
    """All numbers by block size."""
    out = {}
    for block in BLOCKS:
        rounds = [{kind: one_round(kind, block) for kind in KINDS} for _ in range(ROUNDS)]
        values = {}
        for kind in KINDS:
            for key in rounds[0][kind]:
                values[f"{kind}_{key}"] = statistics.median(one[kind][key] for one in rounds)
                if kind != "bare":
                    ratios = (one[kind][key] / one["bare"][key] for one in rounds)
                    values[f"{kind}_over_bare_{key.removesuffix('_us')}"] = statistics.median(ratios)
        samples, output = frames(block)
        out[f"n = {block}: {len(output)} bytes there, {len(samples)} back"] = values
    return out


if __name__ == "__main__":
    results = measure()
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, values in results.items():
            print(name)
            for key, value in values.items():
                print(f"  {key:34} {value:12.2f}")
