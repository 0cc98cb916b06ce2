"""CAN FD frames over udp_multicast between two processes: ``python -m benchmarks.can_multicast [--seconds S] [--bare]``.

Frames of 64 bytes at 5000/s; the receiver is stopped (SIGSTOP) for a fifth of a second in the middle. Lost frames and processor
time, with our bus or (``--bare``) with python-can's as it is. Needs root, for it runs in a network namespace of its own that
has nothing but loopback.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise

import can

from rig.wire.can.bus import PythonCanBus
from rig.wire.can.frames import BusTiming, Frame

RATE_HZ = 5000.0
STALL_S = 0.2
GROUP = "239.74.163.2"  # any will do where there is only loopback


def multicast_bus() -> PythonCanBus:
    return PythonCanBus("udp_multicast", GROUP, BusTiming(True, 1_000_000, 2_000_000))


def send(seconds: float) -> None:
    """The sender: a frame of 64 bytes each period, at absolute deadlines; prints how many, and its processor time.

    In the middle it stops its parent, the receiver, for `STALL_S`, and goes on sending.
    """
    bus = multicast_bus()
    bus.open()
    time.sleep(1.0)
    count, begin = round(RATE_HZ * seconds), time.monotonic()
    signals = {count // 2: signal.SIGSTOP, count // 2 + round(RATE_HZ * STALL_S): signal.SIGCONT}
    cpu = time.process_time()
    latest = 0.0
    for number in range(count):
        late = time.monotonic() - begin - number / RATE_HZ
        if late < 0.0:
            time.sleep(-late)
        latest = max(latest, late)
        if number in signals:
            os.kill(os.getppid(), signals[number])
        bus.send(Frame(0x301, number.to_bytes(4, "little") + bytes(60), True), 0.1)
    took = time.monotonic() - begin
    print(
        json.dumps(
            {"sent": count, "rate_hz": count / took, "share": (time.process_time() - cpu) / took, "latest_s": latest}
        )
    )
    bus.close()


def receiver(bare: bool) -> tuple[Callable[[float], bytes | None], Callable[[], None]]:
    """How to wait for the data of a frame, and how to end: with our bus, or with python-can's as it is."""
    if not bare:
        ours = multicast_bus()
        ours.open()
        return lambda timeout_s: None if (frame := ours.receive(timeout_s)) is None else frame.data, ours.close
    theirs = can.Bus(interface="udp_multicast", channel=GROUP, fd=True)
    return lambda timeout_s: None if (got := theirs.recv(timeout_s)) is None else bytes(got.data), theirs.shutdown


def receive(seconds: float, bare: bool) -> None:
    """Inside the namespace: start the sender, count what comes."""
    wait, end = receiver(bare)
    sender = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.can_multicast", "--send", "--seconds", str(seconds)],
        stdout=subprocess.PIPE,
        text=True,
    )
    numbers, longest_s, cpu, begin, latest = [], 0.0, 0.0, 0.0, 0.0
    while (data := wait(1.0 if numbers else 10.0)) is not None:
        now = time.monotonic()
        if not numbers:
            cpu, begin = time.process_time(), now
        else:
            longest_s = max(longest_s, now - latest)
        latest, spent = now, time.process_time() - cpu
        numbers.append(int.from_bytes(data[:4], "little"))
    out, _ = sender.communicate()
    said = json.loads(out)
    end()
    print(
        json.dumps(
            {
                "frames sent": said["sent"],
                "frames received": len(numbers),
                "lost": said["sent"] - len(set(numbers)),
                "out of order": sum(later <= earlier for earlier, later in pairwise(numbers)),
                "receiver stood still, ms": 1e3 * longest_s,
                "sent a second": said["rate_hz"],
                "sender's share of a core": said["share"],
                "receiver's share of a core": spent / (latest - begin),
                "latest send, ms": 1e3 * said["latest_s"],
            }
        )
    )


def multicast(seconds: float, bare: bool = False) -> dict[str, float]:
    """The figures of `receive` in a network namespace that has nothing but loopback; empty without the privilege."""
    again = f"{sys.executable} -m benchmarks.can_multicast --receive --seconds {seconds} {'--bare' * bare}"
    command = f"ip link set lo up && ip route add 224.0.0.0/4 dev lo && {again}"
    done = subprocess.run(["unshare", "-n", "sh", "-c", command], capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"udp_multicast was not measured: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return {}
    figures: dict[str, float] = json.loads(done.stdout)
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--bare", action="store_true", help="python-can's bus as it is")
    for hidden in ("--send", "--receive"):
        parser.add_argument(hidden, action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.send:
        return send(given.seconds)
    if given.receive:
        return receive(given.seconds, given.bare)
    return print(json.dumps(multicast(given.seconds, given.bare), indent=2))


if __name__ == "__main__":
    main()
