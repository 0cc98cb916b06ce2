"""A run of load.c, instruction by instruction: QEMU logs the address of each that it executes."""

import re
import subprocess
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tools import QEMU, SEMIHOSTING, output_of

CALLERS = ("steady", "continued_short", "continued_longest", "ramp", "ramp_by_main_loop")
CALLED = ("vl_output", "vl_input", "vl_serve")
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
        elif name in ("main", "drive"):
            self._in_steady, self._caller = False, ""
        self.counts.steady += self._in_steady
        if name.startswith(("vl_", "board_", "host_")) or not name.startswith(("mem", "__")):
            self._owner = name
        if not self._owner.startswith(("board_", "host_")):  # the host is in the same program
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
