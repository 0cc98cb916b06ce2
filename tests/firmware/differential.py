"""The same script for the emulator's device in Python and for the firmware's in C, and every difference between the two.

Run as a program it plays many random scripts: ``python -m tests.firmware.differential PROGRAM --requests 100000``.
"""

import argparse
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from rig.wire.can.frames import Frame
from rig.wire.messages import ARM_KEY, Command, Parameter
from tests.firmware.comparing import Difference, differences, sort_out
from tests.firmware.events import CAN, CAN_FD, SERIAL, Choice, Event, events_in
from tests.firmware.host import Host
from tests.firmware.python_device import PythonDevice

REFUSED = 2
"""Exit status of the script's program for a device that does not fit the protocol."""

DEFECTS = range(1, 7)
"""Of a description: a channel without a name, range or scale, an output without range or scale."""

RATES_MHZ = (1_000_000, 997_013, 5_003_009)
"""Sample rates of the scripts: a period of whole microseconds, and two others."""


def run_firmware(program: Path, script: bytes) -> list[Event]:
    """What the firmware does with a script. Raises `RuntimeError` with what a sanitizer says."""
    ended = subprocess.run([program], input=script, capture_output=True, timeout=300, check=False)
    if ended.returncode:
        raise RuntimeError(ended.stderr.decode(errors="replace")[:4000])
    return list(events_in(ended.stdout))


def is_refused(program: Path, choice: Choice) -> bool:
    """Whether the firmware refuses to be such a device."""
    done = subprocess.run([program], input=choice.header(), capture_output=True, timeout=60, check=False)
    return done.returncode == REFUSED and b"refused" in done.stderr


def replayed(choice: Choice, events: Sequence[Event]) -> PythonDevice:
    """The Python device after a script."""
    python = PythonDevice(choice)
    for event in events:
        python.play(event)
    return python


def compare(program: Path, choice: Choice, events: Sequence[Event]) -> list[Difference]:
    """All differences in a script."""
    python = replayed(choice, events)
    return differences(python, run_firmware(program, python.script(events)))


def shortest(program: Path, choice: Choice, events: Sequence[Event]) -> list[Event]:
    """The events of a script without those that a difference does not need."""
    left, piece = list(events), max(1, len(events) // 2)
    while True:
        at = 0
        while at < len(left):
            fewer = left[:at] + left[at + piece :]
            try:
                differs = bool(compare(program, choice, fewer))
            except RuntimeError:
                differs = True
            if differs:
                left = fewer
            else:
                at += piece
        if piece == 1:
            return left
        piece //= 2


def random_choice(random: Random) -> Choice:
    """A device of any kind that the protocol allows."""
    wire = random.choice((SERIAL, SERIAL, CAN, CAN_FD))
    rate_mhz = random.choice(RATES_MHZ)
    most = {SERIAL: (1, 2, 4, 31), CAN: (1, 3, 4, 5, 8, 9, 12, 16), CAN_FD: (1, 4, 6, 15, 31)}[wire]
    return Choice(
        wire,
        random.choice(most),
        random.choice((16, 32)) if wire == SERIAL else 16,
        random.randrange(16),
        random.randrange(3),
        random.random() < 0.15,
        0,
        random.choice((rate_mhz, rate_mhz // 3)),
        rate_mhz,
    )


def random_script(seed: int, n_actions: int) -> Host:
    """A host that has played a script of so many actions to the Python device."""
    random = Random(seed)
    host = Host(random_choice(random), random)
    for _ in range(n_actions):
        host.act()
    return host


def far_script(choice: Choice, blocks: int, block: int = 1, version: int = 1) -> Host:
    """A host that drives blocks of ``block`` samples beyond ``blocks``: at the beginning, then nothing, then again.

    In version 2 the vibration goes on in between.
    """
    host = Host(choice, Random(blocks))
    host.request(Command.SET, Parameter.VERSION, 0, version)
    for parameter, value in ((Parameter.BLOCK, block), (Parameter.QUEUE, 3), (Parameter.WATCHDOG_US, 4_000_000_000)):
        host.request(Command.SET, parameter, 0, value)
    host.request(Command.START)
    host.request(Command.ARM, value=ARM_KEY)
    host.period = 0 if version == 1 else 1_000_000
    if version > 1 and choice.wire != SERIAL:
        host.send_frame(Frame(0x050 + choice.node, struct.pack("<II", host.period, 0)))
    for part in range(3):
        host.drive(100)
        if part == 0:
            host.wait(1e9 * block * (blocks - 200) / choice.highest_rate_mhz)
    host.request(Command.STOP)
    return host


def choices_that_are_refused() -> list[Choice]:
    """Devices that do not fit the protocol or its wire."""
    return [
        Choice(n_channels=0),
        Choice(n_channels=32),
        Choice(bits=24),
        Choice(simulated=3),
        Choice(lowest_rate_mhz=0),
        Choice(lowest_rate_mhz=2_000_000),
        Choice(shortest_watchdog_us=0),
        Choice(shortest_watchdog_us=5, longest_watchdog_us=4),
        Choice(CAN, bits=32),
        Choice(CAN, n_channels=17),
        Choice(CAN, node=16),
        Choice(CAN_FD, bits=32),
        Choice(CAN_FD, node=16),
        *(Choice(defect=defect) for defect in DEFECTS),
    ]


class Sum(NamedTuple):
    """What was compared."""

    scripts: int = 0
    requests: int = 0
    streams: int = 0
    answers: int = 0
    heartbeats: int = 0
    blocks: int = 0
    samples: int = 0

    def plus(self, host: Host) -> "Sum":
        python = host.python
        said = sort_out(python.choice, python.link.sent, [block.size for block in python.plant.blocks])
        samples = sum(block.size for block in python.plant.blocks)
        more = (1, host.requests, host.streams, len(said.answers), len(said.heartbeats), len(said.rows), samples)
        return Sum(*(one + other for one, other in zip(self, more, strict=True)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Play scripts until so many requests were made."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path, help="the firmware's script board: make -C firmware script")
    parser.add_argument("--requests", type=int, default=100_000)
    parser.add_argument("--actions", type=int, default=150, help="in each script")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="a folder for scripts, as inputs of the program")
    chosen = parser.parse_args(arguments)
    total, seed = Sum(), chosen.seed
    differing = sum(not is_refused(chosen.program, choice) for choice in choices_that_are_refused())
    began = time.monotonic()
    while total.requests < chosen.requests:
        host = random_script(seed, chosen.actions)
        total = total.plus(host)
        script = host.python.script(host.events)
        if chosen.keep is not None:
            (chosen.keep / f"{seed}.script").write_bytes(script)
        try:
            found = differences(host.python, run_firmware(chosen.program, script))
        except (RuntimeError, subprocess.TimeoutExpired) as error:
            found = [Difference("the firmware's program", 0, "", str(error)[:2000])]
        if found:
            differing += 1
            print(f"seed {seed}, {host.choice}: {len(found)} differences, the first: {found[0]}", flush=True)
        seed += 1
    print(f"{total}, differing scripts: {differing}, {time.monotonic() - began:.0f} s")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
