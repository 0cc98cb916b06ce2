"""The CAN wire in numbers: ``python -m benchmarks.can_wire [--json] [--seconds S]``.

1. Decoding a frame of 32 signals: compiled layout beside cantools.
2. Receiving a frame of 64 bytes through an adapter on a pseudo-terminal: our lines beside python-can's slcan.
3. CAN FD frames of 64 bytes at 5000/s between two processes over udp_multicast, the receiver stopped (SIGSTOP) for a fifth
   of a second in the middle: lost frames and processor time, with our bus and with python-can's as it is. Needs root, for it
   runs in a network namespace of its own that has nothing but loopback.
"""

import argparse
import json
import math
import os
import timeit
from collections.abc import Callable
from functools import partial
from typing import Any

import can
import cantools
import numpy as np

from benchmarks.can_multicast import RATE_HZ, STALL_S, multicast
from rig.wire.can.frames import BusTiming, Frame
from rig.wire.can.layout import compile_text
from rig.wire.can.slcan import SlcanBus
from rig.wire.can.slcan_lines import encode_line
from rig.wire.serial.port import open_pseudo_terminal

ROUNDS = 60
BATCH = 16
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
    ours = SlcanBus(one.path, BusTiming(True))
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=12.0, help="of multicast")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    stream = f"udp_multicast, 64 bytes at {RATE_HZ:g} frames/s, receiver stopped for {1e3 * STALL_S:g} ms"
    results = {
        "decoding 32 signals, us": decoding(),
        "frame of 64 bytes through an adapter, us": adapter(),
        stream: multicast(given.seconds),
        f"{stream}, python-can's bus as it is": multicast(given.seconds, bare=True),
    }
    if given.json:
        return print(json.dumps(results))
    for title, figures in results.items():
        print(title)
        for name, value in figures.items():
            print(f"  {name:32s} {value:10.3g}" if value < 1e4 else f"  {name:32s} {value:10.0f}")
    return None


if __name__ == "__main__":
    main()
