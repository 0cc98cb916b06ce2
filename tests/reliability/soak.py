"""A long run by the wall clock over an emulated serial device: memory, stalls, lost and held samples, minute by minute.

``python -m tests.reliability.soak [--minutes 60] [--rate 5000] [--block 50]``
"""

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import rig
from rig.arming.run_options import Silent
from rig.bench import Bench, load_bench
from rig.emulator.emulated import emulated
from rig.recording.reader import Recording
from rig.tick.tick import Tick
from tests.rig.campaigns.running.test_runs import plan_with


class Soaked(NamedTuple):
    """What a long run came to."""

    minutes: float
    samples: int
    lost: int
    held: int
    overruns: int
    stalls: str
    first_mb: float
    """Memory of the campaign's process after the first tenth of the time."""
    last_mb: float
    ended: str
    rows_wrong: int
    """Rows of gaps that were not counted as lost samples, or counted ones that are none."""


class _Clock(Silent):
    """Looks at the memory once a second, and ends the run by a signal once so many rows have been recorded."""

    def __init__(self, n_rows: int) -> None:
        self._rows_left = n_rows
        self._next_s = 0.0
        self.memory_mb: list[float] = []

    def advance(self, rows: Any, tick: Tick) -> None:
        """Rows have come."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + 1.0
            self.memory_mb.append(_resident_mb())
        asked_already = self._rows_left <= 0
        self._rows_left -= len(rows)
        if self._rows_left <= 0 and not asked_already:
            signal.raise_signal(signal.SIGTERM)


def soak(minutes: float, rate_hz: float, block: int) -> Soaked:
    """Points of the magnet beam, level after level, for so many minutes."""
    table = load_bench("magnet-beam").model_dump()
    table |= {"sample_rate_hz": rate_hz, "block": block}
    table["limits"] |= {"frequency_hz": (8.0, 200.0)}
    table["driver"]["options"]["converter"] = {
        "substeps": max(2, round(10_000 / rate_hz)),
        "oversampling": 1,
        "anti_alias_hz": 0.0,
    }
    clock = _Clock(round(60.0 * minutes * rate_hz))
    levels = tuple(0.3 + 1e-4 * k for k in range(min(5000, max(4, int(20 * minutes)))))
    with tempfile.TemporaryDirectory(prefix="vibrolock-soak-") as folder:
        output = Path(folder) / "soak.h5"
        with emulated(Bench.model_validate(table), "serial", seed=1, lockstep=False) as bench:
            rig.run(plan_with(levels_v=levels), bench=bench, output=output, progress=clock).close()
        with Recording(output) as recording:
            return _judged(recording, clock, rate_hz)


def _judged(recording: Recording, clock: _Clock, rate_hz: float) -> Soaked:
    (part,) = recording.parts
    end = part.end or {}
    counters, loop = end.get("counters", {}), end.get("loop", {})
    inputs = part.rows("inputs")
    not_numbers = int((inputs != inputs).all(axis=1).sum())
    lost = int(counters.get("lost_samples", 0))
    first = clock.memory_mb[len(clock.memory_mb) // 10]
    return Soaked(
        part.n_rows / rate_hz / 60.0,
        part.n_rows,
        lost,
        int(counters.get("output_held", 0)),
        int(loop.get("overruns", 0)),
        str(loop.get("real_time", {}).get("stalls", "-")),
        first,
        clock.memory_mb[-1],
        str(end.get("text", "no end")),
        abs(not_numbers - lost),
    )


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


def table(found: Sequence[Soaked]) -> list[str]:
    """Soaks as a table."""
    lines = ["| minutes | samples | lost | held | overruns | stalls | memory, MB | ended |", "|---|" + "---|" * 7]
    for one in found:
        lines.append(
            f"| {one.minutes:.1f} | {one.samples} | {one.lost} | {one.held} | {one.overruns} | {one.stalls} | "
            f"{one.first_mb:.0f} to {one.last_mb:.0f} | {one.ended} |"
        )
    return lines


def main() -> int:
    """Soak, and print."""
    parser = argparse.ArgumentParser(description="A long run by the wall clock over an emulated serial device.")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=5000.0, help="samples/s")
    parser.add_argument("--block", type=int, default=50, help="samples a block; larger ones stand a busier machine")
    wanted = parser.parse_args()
    found = soak(wanted.minutes, wanted.rate, wanted.block)
    print("\n".join(table([found])))
    return int(found.rows_wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
