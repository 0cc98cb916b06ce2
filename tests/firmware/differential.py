"""The same script for the emulator's device in Python and for the firmware's in C, and every difference between the two.

Run as a program it plays many random scripts: ``python -m tests.firmware.differential PROGRAM --requests 100000``.
"""

import argparse
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

import numpy as np

from rig.wire.messages import ARM_KEY, Command, DeviceFlag, Parameter
from rig.wire.serial.codec import Malformed
from rig.wire.serial.frames import frame, payload_of
from tests.firmware.events import CAN, CAN_FD, SERIAL, Choice, Event, Kind, events_in
from tests.firmware.host import Host
from tests.firmware.python_device import PythonDevice
from tests.firmware.rows import Rows, SamplesOnBus, rows_of_payload
from tests.firmware.structure import readings

RATES_MHZ = (1_000_000, 997_013, 5_003_009)
"""Sample rates of the scripts: a period of whole microseconds, and two others."""

COMPARED_COUNTERS = {
    "watchdog_trips": 0,
    "emergency_stops": 1,
    "held_blocks": 2,
    "bad_outputs": 5,
    "outputs_while_idle": 7,
    "repeated_requests": 8,
    "repeated_frames": 14,
    "incomplete_blocks": 15,
    "resynchronised": 16,
}
"""Counters that both have, and their place in ``struct vl_counters``."""


class Difference(NamedTuple):
    """What the two say."""

    what: str
    number: int
    python: object
    firmware: object

    def __str__(self) -> str:
        return f"{self.what} {self.number}: emulator {self.python}, firmware {self.firmware}"


class Said(NamedTuple):
    """What a device has sent, by kind; each with its time."""

    answers: list[tuple[int, bytes]]
    heartbeats: list[tuple[int, bytes]]
    rows: list[Rows]
    counters: tuple[int, ...]


def run_firmware(program: Path, script: bytes) -> list[Event]:
    """What the firmware does with a script. Raises `RuntimeError` with what a sanitizer says."""
    ended = subprocess.run([program], input=script, capture_output=True, timeout=300, check=False)
    if ended.returncode:
        raise RuntimeError(ended.stderr.decode(errors="replace")[:4000])
    return list(events_in(ended.stdout))


def sort_out(choice: Choice, sent: Sequence[Event], block_of: Sequence[int]) -> Said:
    """What was sent, by kind; blocks have the sizes ``block_of``, in order."""
    counters = tuple(
        int(word) for event in sent if event.kind == Kind.COUNTERS for word in np.frombuffer(event.data, "<u4")
    )
    if choice.wire == SERIAL:
        answers, heartbeats, rows = _of_the_line(choice, sent)
    else:
        answers, heartbeats, rows = _of_the_bus(choice, sent, block_of)
    return Said(answers, heartbeats, rows, counters)


def _of_the_line(choice: Choice, sent: Sequence[Event]) -> tuple[list, list, list]:
    by_type: dict[int, list] = {2: [], 3: [], 5: []}
    rest = b""
    for event in sent:
        if event.kind != Kind.BYTES:
            continue
        *frames, rest = (rest + event.data).split(b"\0")
        for one in frames:
            if one:
                payload = payload_of(one)
                assert frame(payload) == one + b"\0", "COBS in another form"
                by_type[payload[1]].append((event.time_us, payload))
    assert not rest, "a frame without its end"
    rows = [rows_of_payload(time_us, payload, choice) for time_us, payload in by_type[3]]
    return by_type[2], by_type[5], rows


def _of_the_bus(choice: Choice, sent: Sequence[Event], block_of: Sequence[int]) -> tuple[list, list, list]:
    answers, heartbeats = [], []
    samples = SamplesOnBus(choice, block_of)
    for event in sent:
        if event.kind != Kind.FRAME:
            continue
        function = int.from_bytes(event.data[:2], "little") & ~0xF
        if function == 0x030:
            answers.append((event.time_us, event.data))
        elif function == 0x010:
            heartbeats.append((event.time_us, event.data))
        else:
            samples.take(event)
    return answers, heartbeats, samples.rows


def differences(python: PythonDevice, firmware_sent: Sequence[Event]) -> list[Difference]:
    """All that is not the same."""
    sizes = [block.size for block in python.plant.blocks]
    ours = sort_out(python.choice, python.link.sent, sizes)
    try:
        theirs = sort_out(python.choice, firmware_sent, sizes)
    except (AssertionError, Malformed) as error:
        return [Difference("what the firmware says is no message", 0, "", repr(error))]
    out = [
        *_differences_of("answer", ours.answers, theirs.answers),
        *_differences_of("heartbeat", ours.heartbeats, theirs.heartbeats),
        *_differences_of_rows(python, ours.rows, theirs.rows),
    ]
    if not python.was_reset:
        both = python.device.counts + Counter(python.link.counters)
        for name, place in COMPARED_COUNTERS.items():
            if both[name] != theirs.counters[place]:
                out.append(Difference(f"counter {name}", 0, both[name], theirs.counters[place]))
    return out


def _differences_of(what: str, ours: list[tuple[int, bytes]], theirs: list[tuple[int, bytes]]) -> list[Difference]:
    out = [
        Difference(what, number, f"{one[0]} {one[1].hex(' ')}", f"{other[0]} {other[1].hex(' ')}")
        for number, (one, other) in enumerate(zip(ours, theirs, strict=False))
        if one[1] != other[1] or abs(one[0] - other[0]) > 1
    ]
    if len(ours) != len(theirs):
        out.append(Difference(f"number of {what}s", min(len(ours), len(theirs)), len(ours), len(theirs)))
    return out


def _differences_of_rows(python: PythonDevice, ours: list[Rows], theirs: list[Rows]) -> list[Difference]:
    out: list[Difference] = []
    choice, plant, link = python.choice, python.plant, python.link
    ramp_from = 0.0
    for number, (one, other) in enumerate(zip(ours, theirs, strict=False)):
        put_out, first, flags = plant.blocks[number], plant.firsts[number], link.flags[number]
        head, their_head = one._replace(counts=None), other._replace(counts=None)
        if not head.is_like(their_head):
            out.append(Difference("block", number, head, their_head))
        if other.counts.shape != one.counts.shape:
            out.append(Difference("block's shape", number, one.counts.shape, other.counts.shape))
            continue
        count = other.counts[:, 0].astype(np.int64)
        if not np.array_equal(readings(count, first, choice.n_channels, choice.bits), other.counts):
            out.append(Difference("structure", number, one.counts.tolist(), other.counts.tolist()))
        allowed = _allowed(put_out, flags, ramp_from, link.ramps_us[number])
        ramp_from = max(float(np.abs(put_out).max()), ramp_from * bool(flags & DeviceFlag.WATCHDOG))
        wrong = np.abs(count - put_out) > allowed
        if wrong.any():
            at = int(np.flatnonzero(wrong)[0])
            out.append(Difference("output", first + at, put_out[at : at + 5].tolist(), count[at : at + 5].tolist()))
    if len(ours) != len(theirs):
        out.append(Difference("number of blocks", min(len(ours), len(theirs)), len(ours), len(theirs)))
    return out


def _allowed(put_out: np.ndarray, flags: int, ramp_from: float, ramp_us: int) -> np.ndarray:
    """By how much the outputs [n] may differ: under a ramp by a count, and by what it falls in two microseconds."""
    if not flags & DeviceFlag.WATCHDOG or ramp_us == 0:
        return np.zeros(put_out.size)
    is_ramp = (put_out != np.rint(put_out)) | (np.abs(put_out) < ramp_from)
    return np.where(is_ramp, 1.0 + 2.0 * max(ramp_from, float(np.abs(put_out).max())) / ramp_us, 0.0)


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


def far_script(choice: Choice, blocks: int, block: int = 1) -> Host:
    """A host that drives blocks of ``block`` samples beyond ``blocks``: at the beginning, then nothing, then again."""
    host = Host(choice, Random(blocks))
    for parameter, value in ((Parameter.BLOCK, block), (Parameter.QUEUE, 3), (Parameter.WATCHDOG_US, 4_000_000_000)):
        host.request(Command.SET, parameter, 0, value)
    host.request(Command.START)
    host.request(Command.ARM, value=ARM_KEY)
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
    total, seed, differing = Sum(), chosen.seed, 0
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
