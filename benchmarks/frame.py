"""What the scripts share: work that is timed in turn, and results on standard output."""

import os
from collections.abc import Callable, Mapping
from typing import Any

from rig.text.console import print_json


def in_turn(work: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, list[float]]:
    """Call all work in turn, round after round, so that what else the machine does falls on all alike; return what it gives."""
    found: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, once in work.items():
            found[name].append(once())
    return found


def on_one_core() -> None:
    """Keep this process on one core, where the system lets it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def show(found: Mapping[str, Any], json: bool = False, indent: str = "") -> None:
    """Print results as JSON, or one number a line, the numbers of a table below its name."""
    if json:
        print_json(found)
        return
    for name, value in found.items():
        if isinstance(value, Mapping):
            print(f"{indent}{name}")
            show(value, indent=f"{indent}  ")
        else:
            print(f"{indent}{name:40} {f'{value:.5g}' if isinstance(value, float) else value}", flush=True)
