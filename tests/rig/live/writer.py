"""A process that publishes a made run: ``writer.py KIND NUMBER``. It prints its folder, publishes, says ``done`` and waits.

All numbers of a frame are the number of its last sample, so that a reader sees whether they were written together.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from rig.campaigns.plans import load_plan
from rig.campaigns.running.watched import watched_facts
from rig.live.publisher import Publisher
from rig.tick.layout import recorded_row
from tests.rig.rigs import bench_with, tick_for

ROWS = 500
BENCH = bench_with()
FACTS = watched_facts(load_plan("magnet-beam/backbone"), BENCH, Path("/nowhere/made.h5"), {})


def made_loop():
    """A loop that runs nothing: its tick can be set to any sample."""
    tick = tick_for(BENCH, 21.0)
    return SimpleNamespace(tick=tick, failure=None, statistics=SimpleNamespace(overruns=0), lateness_us=(np.nan,) * 4)


def chunk(loop, number):
    """Rows of chunk ``number`` from 0, with the loop after them. The lock changes with each, so that each gives a frame."""
    rows = np.zeros(ROWS, recorded_row(len(BENCH.channels)))
    last = (number + 1) * ROWS
    loop.tick.arrays.loop["sample"] = last
    loop.tick.arrays.progress["level"] = last
    loop.tick.arrays.guard["value"] = last
    rows["inputs"], rows["frequency_hz"] = last, last
    rows["lock"], rows["guard"] = number % 2, 1
    return rows


if __name__ == "__main__":
    kind, count = sys.argv[1], int(sys.argv[2])
    loop = made_loop()
    with Publisher(FACTS, len(BENCH.channels)) as live:
        print(live.folder, flush=True)
        live.line("part", {"first_sample": 0})
        number = 0
        while number < count or kind == "hammer":
            live.take(chunk(loop, number), loop, number, count)
            if kind == "lines":
                live.line("point", {"number": number, "text": "é" * number})
            number += 1
        print("done", flush=True)
        sys.stdin.readline()
