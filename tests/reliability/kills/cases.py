"""Where a run is killed, on what device, and which of its processes."""

import random
from collections.abc import Iterator
from typing import NamedTuple

PHASES = (
    "opening",
    "before the first row",
    "loop",
    "evaluation",
    "conversion",
    "file in place",
    "overwrite before the start",
    "overwrite in the loop",
    "resume",
)
DEVICES = ("virtual", "real time", "serial", "can")
LOOP_PROCESS = ("real time", "serial", "can")
"""Devices whose loop has a process of its own."""

_MOST_WRITES = {"virtual": 12, "real time": 60, "serial": 40, "can": 40}


class Case(NamedTuple):
    """One kill."""

    phase: str
    device: str
    victim: str
    """``campaign`` or ``loop``: which process."""
    at: int
    """How many writes, chunks or points come before it, counted from the beginning of the phase."""

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.phase}, {self.device}, {self.victim}, {self.at}"


def every(seed: int) -> Iterator[Case]:
    """Every phase on every device once, campaign and loop, each at a place drawn by the seed."""
    chance = random.Random(seed)
    for device in DEVICES:
        for phase in PHASES:
            yield Case(phase, device, "campaign", _place(phase, device, chance))
        if device in LOOP_PROCESS:
            yield Case("loop", device, "loop", _place("loop", device, chance))


def drawn(number: int, seed: int) -> list[Case]:
    """So many cases: every one once, and then such as take little time, at places drawn by the seed."""
    cases = list(every(seed))
    chance = random.Random(seed + 1)
    devices = [*["virtual"] * 6, *DEVICES]
    while len(cases) < number:
        device = chance.choice(devices)
        victim = chance.choice(("campaign", "loop")) if device in LOOP_PROCESS else "campaign"
        phase = chance.choice(PHASES) if victim == "campaign" else "loop"
        cases.append(Case(phase, device, victim, _place(phase, device, chance)))
    return cases[:number]


def _place(phase: str, device: str, chance: random.Random) -> int:
    if phase in ("loop", "overwrite in the loop", "resume"):
        return chance.randrange(1, _MOST_WRITES[device])
    return chance.randrange(2) if phase in ("evaluation", "conversion") else 0
