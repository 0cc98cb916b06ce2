"""The CAN wire in numbers: ``python -m benchmarks.can_wire [--json] [--seconds S]``.

1. Decoding a frame of 32 signals: compiled layout beside cantools.
2. Receiving a frame of 64 bytes through an adapter on a pseudo-terminal: our lines beside python-can's slcan.
3. CAN FD frames of 64 bytes at 5000/s between two processes over udp_multicast: lost frames and processor time. Needs
   root, for it runs in a network namespace of its own that has nothing but loopback.
"""

import json
import math
import os
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import can
import cantools
import numpy as np

from rig.wire.can.bus import PythonCanBus
from rig.wire.can.dbc import compile_text
from rig.wire.can.frames import Frame
from rig.wire.can.slcan import SlcanBus, encode_line
from rig.wire.serial.pty import open_pseudo_terminal

ROUNDS = 60
BATCH = 16
RATE_HZ = 5000.0
GROUP = "239.74.163.2"  # any will do where there is only loopback
SIGNALS = "".join(f' SG_ s{n} : {16 * n}|16@1- (0.5,0) [0|0] "V" B\n' for n in range(32))
DBC = (
    f'VERSION ""\n\nBU_: A B\n\nBO_ 100 M: 64 A\n{SIGNALS}\n'
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG",'
    + '"reserved",' * 10
    + '"StandardCAN_FD","ExtendedCAN_FD";\nBA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ 100 14;\n'
)


def in_turn(work: dict[str, Callable[[], Any]], round_s: float = 2e-3) -> dict[str, float]:
    """Time of a call in the quickest round, us: what it costs on a machine that is left alone.

    The ways are taken in turn, in rounds of about equal time, so that what else the machine does falls on all alike.
    """
    calls = {
        name: max(1, round(round_s / min(timeit.repeat(function, number=3)) * 3)) for name, function in work.items()
    }
    least = dict.fromkeys(work, math.inf)
    for _ in range(ROUNDS):
        for name, function in work.items():
            took_s = timeit.timeit(function, number=calls[name]) / calls[name]
            least[name] = min(least[name], 1e6 * took_s)
    return least


def decoding() -> dict[str, float]:
    """Us a frame of 32 signals: cantools' usual call, ours, and ours for several frames at once; raw counts likewise."""
    rng = np.random.default_rng(0)
    frames = [rng.bytes(64) for _ in range(BATCH)]
    data = frames[0]
    ways: dict[str, Callable[[], Any]] = {}
    for name, text in (("scale", DBC), ("scale and offset", DBC.replace("(0.5,0)", "(0.5,1)"))):
        theirs: Any = cantools.database.load_string(text, "dbc")
        message, ours = theirs.messages[0], compile_text(text).messages["M"]
        assert np.array_equal(ours.physical(data), list(message.decode(data).values()))
        ways[f"cantools, {name}"] = partial(message.decode, data)
        ways[f"compiled, {name}"] = partial(ours.physical, data)
        ways[f"{BATCH} at once, {name}"] = partial(ours.physical_values, frames)
    ways["cantools, raw"] = partial(message.decode, data, decode_choices=False, scaling=False)
    ways["compiled, raw"] = partial(ours.decode, data)
    times = in_turn(ways)
    for name in ("scale", "scale and offset"):
        times[f"{BATCH} at once, {name}"] /= BATCH
        times[f"ratio of {BATCH}, {name}"] = times[f"cantools, {name}"] / times[f"{BATCH} at once, {name}"]
    for name in ("raw", "scale", "scale and offset"):
        times[f"ratio, {name}"] = times[f"cantools, {name}"] / times[f"compiled, {name}"]
    return times


def adapter() -> dict[str, float]:
    """Us a frame of 64 bytes from the pseudo-terminal to the caller."""
    frame = Frame(0x310, bytes(range(64)), True)
    text = encode_line(frame)
    one, other = open_pseudo_terminal(), open_pseudo_terminal()
    ours = SlcanBus(one.path, True)
    ours.open()
    with can.Bus(interface="slcan", channel=other.path, bitrate=1_000_000, sleep_after_open=0.0) as theirs:

        def receive_ours() -> None:
            os.write(one.descriptor, text)
            while (got := ours.receive(1.0)) is None:
                pass
            assert got == frame

        def receive_theirs() -> None:
            os.write(other.descriptor, text)
            got = theirs.recv(1.0)
            assert got is not None
            assert bytes(got.data) == frame.data

        times = in_turn({"python-can": receive_theirs, "ours": receive_ours})
    ours.close()
    one.close()
    other.close()
    times["ratio"] = times["python-can"] / times["ours"]
    return times


def multicast_bus() -> PythonCanBus:
    return PythonCanBus("udp_multicast", GROUP, True, 1_000_000, 2_000_000)


def send(seconds: float) -> None:
    """The sender: a frame of 64 bytes each period, at absolute deadlines; prints how many, and its processor time."""
    bus = multicast_bus()
    bus.open()
    time.sleep(1.0)
    count, begin = round(RATE_HZ * seconds), time.monotonic()
    cpu = time.process_time()
    latest = 0.0
    for number in range(count):
        late = time.monotonic() - begin - number / RATE_HZ
        if late < 0.0:
            time.sleep(-late)
        latest = max(latest, late)
        bus.send(Frame(0x301, number.to_bytes(4, "little") + bytes(60), True), 0.1)
    took = time.monotonic() - begin
    print(
        json.dumps(
            {"sent": count, "rate_hz": count / took, "share": (time.process_time() - cpu) / took, "latest_s": latest}
        )
    )
    bus.close()


def receive(seconds: float) -> None:
    """Inside the namespace: start the sender, count what comes."""
    bus = multicast_bus()
    bus.open()
    sender = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.can_wire", "--send", str(seconds)], stdout=subprocess.PIPE, text=True
    )
    numbers, cpu, begin = [], 0.0, 0.0
    while True:
        frame = bus.receive(5.0 if not numbers else 1.0)
        if frame is None:
            break
        if not numbers:
            cpu, begin = time.process_time(), time.monotonic()
        numbers.append(int.from_bytes(frame.data[:4], "little"))
        last = (time.process_time() - cpu, time.monotonic() - begin)
    out, _ = sender.communicate()
    said = json.loads(out)
    bus.close()
    print(
        json.dumps(
            {
                "frames sent": said["sent"],
                "frames received": len(numbers),
                "lost": said["sent"] - len(set(numbers)),
                "out of order": sum(later <= earlier for earlier, later in pairwise(numbers)),
                "sent a second": said["rate_hz"],
                "sender's share of a core": said["share"],
                "receiver's share of a core": last[0] / last[1],
                "latest send, ms": 1e3 * said["latest_s"],
            }
        )
    )


def multicast(seconds: float) -> dict[str, float]:
    """The figures of `receive` in a network namespace that has nothing but loopback; empty without the privilege."""
    again = f"{sys.executable} -m benchmarks.can_wire --receive {seconds}"
    command = f"ip link set lo up && ip route add 224.0.0.0/4 dev lo && {again}"
    done = subprocess.run(["unshare", "-n", "sh", "-c", command], capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"udp_multicast was not measured: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return {}
    figures: dict[str, float] = json.loads(done.stdout)
    return figures


def main() -> None:
    arguments = sys.argv[1:]
    seconds = float(arguments[arguments.index("--seconds") + 1]) if "--seconds" in arguments else 12.0
    if "--send" in arguments:
        return send(float(arguments[-1]))
    if "--receive" in arguments:
        return receive(float(arguments[-1]))
    results = {
        "decoding 32 signals, us": decoding(),
        "frame of 64 bytes through an adapter, us": adapter(),
        f"udp_multicast, 64 bytes at {RATE_HZ:g} frames/s": multicast(seconds),
    }
    if "--json" in arguments:
        return print(json.dumps(results))
    for title, figures in results.items():
        print(title)
        for name, value in figures.items():
            print(
                f"  {name:28s} {value:10.3g}"
                if value < 1e4 or not math.isfinite(value)
                else f"  {name:28s} {value:10.0f}"
            )
    return None


if __name__ == "__main__":
    main()
