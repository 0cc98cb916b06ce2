"""Instructions of the core, counted one by one: QEMU logs the address of each that it executes.

QEMU counts instructions, not cycles, and knows no wait states of a flash. What the board's own functions need is left out.
"""

import re
import subprocess
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tools import OPTIMISATIONS, QEMU, SEMIHOSTING, WIRES, load, output_of, said, table

BLOCKS = (1, 5, 10)
CALLERS = ("steady", "ramp", "ramp_by_main_loop")
CALLED = ("vl_output", "vl_input", "vl_serve")
RATE_HZ = 5000
CLOCK_HZ = 170e6
TIMER_TICK = 40  # instructions: 25 MHz where an instruction takes 1 ns
TRACE = re.compile(rb"^Trace 0: \S+ \[\w+/(\w+)/")


@dataclass
class Counts:
    """What one run of load.c has executed. Keys: the caller (`CALLERS`) and the function called."""

    calls: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    """Instructions of each call."""
    by_function: dict[tuple[str, str], Counter[str]] = field(default_factory=dict)
    """The same, all calls together, by the function that holds them."""
    locked: int = 0
    """Most instructions between board_lock and board_unlock."""
    steady: int = 0
    """All instructions from the entry of ``steady`` to its end, those of the host and the board included."""


class Functions:
    """Names of functions by address."""

    def __init__(self, elf: Path) -> None:
        symbols = [line.split() for line in output_of("arm-none-eabi-nm", "-n", str(elf)).splitlines()]
        code = [
            (int(words[0], 16), words[2]) for words in symbols if words[1] in "tTW" and not words[2].startswith("$")
        ]
        self._addresses, self._names = [one[0] for one in code], [one[1] for one in code]
        self._known: dict[bytes, tuple[str, bool]] = {}

    def at(self, address: bytes) -> tuple[str, bool]:
        """The function at an address in hexadecimal digits, and whether it begins there."""
        if address not in self._known:
            number = int(address, 16)
            place = bisect_right(self._addresses, number) - 1
            self._known[address] = self._names[place], self._addresses[place] == number
        return self._known[address]


def is_boards(name: str) -> bool:
    """Whether a function belongs to the board, or to the host in the same program."""
    return name.startswith(("board_", "host_"))


class Reader:
    """Follows the trace of a run, an instruction at a time."""

    def __init__(self) -> None:
        self.counts = Counts()
        self._caller = ""
        self._call: tuple[str, str] | None = None
        self._inside = Counter[str]()
        self._owner = ""  # the last function that is of no library
        self._locked = -1
        self._in_steady = False

    def take(self, name: str, begins: bool) -> None:
        """An instruction of a function, maybe its first."""
        if name in CALLERS:
            self._end_call()
            self._in_steady, self._caller = name == "steady", name
        elif self._call is None and begins and name in CALLED and self._caller:
            self._call = self._caller, name
        elif name == "main":
            self._in_steady, self._caller = False, ""
        self.counts.steady += self._in_steady
        if name.startswith(("vl_", "board_", "host_")) or not name.startswith(("mem", "__")):
            self._owner = name
        if not is_boards(self._owner):
            self._count(name)
        elif begins and name == "board_lock":
            self._locked = 0
        elif begins and name == "board_unlock":
            self.counts.locked = max(self.counts.locked, self._locked)
            self._locked = -1

    def _count(self, name: str) -> None:
        if self._call is not None:
            self._inside[name] += 1
        if self._locked >= 0:
            self._locked += 1

    def _end_call(self) -> None:
        if self._call is None:
            return
        self.counts.calls.setdefault(self._call, []).append(self._inside.total())
        self.counts.by_function.setdefault(self._call, Counter()).update(self._inside)
        self._call = None
        self._inside.clear()


def traced(elf: Path) -> Counts:
    """Run a program of load.c, one instruction at a time. `RuntimeError` where it says that the core did not do its work."""
    functions, reader = Functions(elf), Reader()
    command = [*QEMU, *SEMIHOSTING, "-singlestep", "-d", "exec,nochain", "-kernel", str(elf)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as qemu:
        assert qemu.stderr is not None
        for line in qemu.stderr:
            if found := TRACE.match(line):
                reader.take(*functions.at(found[1]))
    if qemu.returncode:
        raise RuntimeError(f"{elf.name}: status {qemu.returncode}: blocks are missing, or were held")
    return reader.counts


def mean(numbers: list[int]) -> float:
    """Their mean."""
    return sum(numbers) / len(numbers)


def by_block(calls: list[int], block: int) -> list[int]:
    """Instructions of vl_serve in each block: one call a sample."""
    return [sum(calls[at : at + block]) for at in range(0, len(calls), block)]


def row(wire: str, optimisation: str, block: int, counts: Counts) -> list[object]:
    """A row of the table of instructions."""
    output, input_, serve = (counts.calls["steady", name] for name in CALLED)
    a_block = by_block(serve, block)
    a_sample = mean(output) + mean(input_) + mean(a_block) / block
    share = 100 * a_sample * RATE_HZ / CLOCK_HZ
    numbers = [f"{mean(one):.0f} / {max(one)}" for one in (output, input_, a_block)]
    return [f"{wire}, {optimisation}", block, *numbers, max(serve), f"{share:.1f}", f"{2 * share:.1f}"]


def at_worst(wire: str, optimisation: str, counts: Counts) -> list[object]:
    """A row of the table of what an interrupt and a lock need at most."""
    output = max(max(calls) for (_, name), calls in counts.calls.items() if name == "vl_output")
    input_ = max(max(calls) for (_, name), calls in counts.calls.items() if name == "vl_input")
    return [f"{wire}, {optimisation}", output, input_, counts.locked]


def hot(counts: Counts) -> str:
    """The functions that hold most of the instructions of the steady calls, a sample."""
    samples = len(counts.calls["steady", "vl_output"])
    all_calls = sum((counts.by_function["steady", name] for name in CALLED), Counter[str]())
    return ", ".join(f"`{name}` {number / samples:.0f}" for name, number in all_calls.most_common(7))


HEAD = [
    "wire",
    "block",
    "`vl_output`",
    "`vl_input`",
    "`vl_serve`, a block",
    "longest call of it",
    "share, %",
    "at 2 cycles, %",
]
HEAD_AT_WORST = ["wire", "`vl_output`", "`vl_input`", "locked"]
HEAD_OF_FUNCTIONS = ["wire", "functions, instructions a sample", "by trace", "by timer"]


def report(build: Path) -> str:
    """Tables of instructions: by block; at worst; by function, with how well trace and timer agree."""
    by_block_, worst, functions = list[list[object]](), list[list[object]](), list[list[object]]()
    for optimisation in OPTIMISATIONS:
        for wire in WIRES:
            for block in BLOCKS:
                elf = load(build, wire, optimisation, block)
                counts = traced(elf)
                by_block_.append(row(wire, optimisation, block, counts))
            worst.append(at_worst(wire, optimisation, counts))
            timed = TIMER_TICK * said(elf)[0]
            functions.append([f"{wire}, {optimisation}", hot(counts), counts.steady, timed])
    return "\n\n".join(
        [
            f"{RATE_HZ} Hz; mean / most. Share: of the cycles of {CLOCK_HZ / 1e6:.0f} MHz at one cycle an instruction.",
            table(HEAD, by_block_),
            "At most, with the watchdog's trip and ramp; locked: between `board_lock` and `board_unlock`.",
            table(HEAD_AT_WORST, worst),
            f"Where they go, at blocks of {BLOCKS[-1]}; and all instructions of the steady part, by two ways of counting.",
            table(HEAD_OF_FUNCTIONS, functions),
        ]
    )
