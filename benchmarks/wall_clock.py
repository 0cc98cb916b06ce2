"""How punctual the wall-clock loop is, beside cyclictest: ``python -m benchmarks.wall_clock [--minutes 2] [--unprivileged]``.

At each rate the loop drives the virtual magnet beam, paced by the host, in blocks of one sample. The parent writes every row
to a journal in one thread while another spins. cyclictest (of Debian's rt-tests) runs in the same minutes, with the same
interval, priority, locked memory and load: both take turns of a quarter of a minute, because two tasks of one priority on
few processors would wait for each other. In its turns the parent goes on spinning, and writes the rows of the turn before
to a second journal, at the same pace. ``--unprivileged`` takes real-time scheduling and locked memory from both.

``missed_percent``, on one footing for both: periods that began more than a period late or were left out, of all.
``overrun_percent`` counts, of the loop alone, also those that took too long. ``stalls_per_minute``: begun more than 1 ms late.
Of the loop's stalls (handed over more than 1 ms late) ``by_its_own_computing`` are those in which its thread itself computed
for more than 1 ms: only these can be Python's, and a virtual machine's host may have caused
them too. In all others somebody else had the processor, as in every stall of
cyclictest, a C program. What could have made one, the collector, imports, page faults and switches, is counted with it.
"""

import shutil
import subprocess
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import typer

from benchmarks.frame import show
from controller import AmplitudeLaw, preset
from rig.bench import Bench, load_bench
from rig.loop.worker.memory import TIMES
from rig.loop.worker.session import WorkerSession
from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter
from rig.system.privileges import PRIORITY
from rig.tick.layout import ROW_COLUMNS
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule
from rig.tick.tick import TickSettings

TURN_S = 15.0
"""Length of a turn of the loop and of cyclictest, s; chosen."""
RATES_HZ = (1000.0, 2000.0, 5000.0)
FREQUENCY_HZ = 24.4
"""Frequency of the tone, Hz: near the resonance of the beam."""
STALL_US = 1000.0
"""Lateness above which a period counts as a stall, us."""
DISTURBANCES = ("collections", "imports", "major_faults", "minor_faults", "involuntary_switches")
COUNTED = (*DISTURBANCES, "stalls", "own_stalls", "skipped_periods")


def bench_at(rate_hz: float) -> Bench:
    """The magnet beam at a rate, its plant with as many sub-steps as keep it exact."""
    table = load_bench("magnet-beam").model_dump()
    table["driver"]["options"]["converter"] = {"substeps": max(2, round(10_000 / rate_hz)), "anti_alias_hz": 0.0}
    table["driver"]["options"]["converter"]["oversampling"] = 1
    table |= {"sample_rate_hz": rate_hz, "block": 1}
    table["limits"] |= {"frequency_hz": (8.0, 200.0)}
    return Bench.model_validate(table)


def held(bench: Bench, seconds: float) -> TickSettings:
    """A tone of half a volt for some seconds."""
    excitation = Excitation(FREQUENCY_HZ)
    segments = [
        Segment(SegmentKind.RAMP, -1, 0.5, 5.0, excitation=excitation),
        Segment(SegmentKind.HOLD, -1, 0.5, FREQUENCY_HZ * seconds, excitation=excitation),
    ]
    return TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), segments)


@contextmanager
def busy_thread() -> Iterator[None]:
    """A thread that computes without a pause, and holds the interpreter as often as it gets it."""
    over = threading.Event()

    def spin() -> None:
        while not over.is_set():
            sum(range(1000))

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def journal_at(path: Path, bench: Bench, dtype: np.dtype[Any]) -> JournalWriter:
    """A journal for the rows of a bench."""
    channels = [channel.model_dump(mode="json") for channel in bench.channels]
    columns = [Column(**column) for column in ROW_COLUMNS]
    header = Header("backbone", {}, channels, dtype, columns, "benchmark", "now", 0)
    return JournalWriter.create(path, header)


def loop_turn(bench: Bench, folder: Path, privileged: bool) -> tuple[dict[str, Any], list[np.ndarray]]:
    """One turn of the loop: its report and the chunks of its rows."""
    chunks = []
    with WorkerSession(bench, privileged=privileged) as session:
        loop = session.start(held(bench, TURN_S))
        with journal_at(folder / f"{time.monotonic_ns()}.journal", bench, loop.tick.row_dtype) as journal:
            journal.part({"first_sample": 0})
            for rows in loop.run():
                journal.rows(rows)
                chunks.append(rows)
        if loop.failure is not None:
            raise loop.failure
        return loop.report, chunks


def cyclictest_turn(
    rate_hz: float, chunks: list[np.ndarray], bench: Bench, folder: Path, privileged: bool
) -> Counter[int]:
    """One turn of cyclictest while the rows are written again: how often each lateness (us) was."""
    command = ["cyclictest", "-q", "-t1", "-h", "100000", "-i", str(round(1e6 / rate_hz)), "-D", str(round(TURN_S))]
    command += ["-m", f"-p{PRIORITY}"] if privileged else ["--policy=other"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        with journal_at(folder / f"{time.monotonic_ns()}.journal", bench, chunks[0].dtype) as journal:
            journal.part({"first_sample": 0})
            due = time.monotonic()
            for rows in chunks:
                if process.poll() is not None:
                    break
                due += rows.size / rate_hz
                time.sleep(max(0.0, due - time.monotonic()))
                journal.rows(rows)
        text = process.communicate()[0]
    if process.returncode != 0:
        raise SystemExit(f"cyclictest has failed with status {process.returncode}")
    counts: Counter[int] = Counter()
    for line in text.splitlines():
        if line and line[0].isdigit():
            lateness, count = line.split()
            if int(count):
                counts[int(lateness)] += int(count)
        elif line.startswith("# Max Latencies"):
            counts[int(line.split(":")[1])] += 0
    return counts


def quantiles(counts: Counter[float]) -> dict[str, float]:
    """p50, p99, p99.9 and the largest of counted times."""
    values = np.array(sorted(counts))
    seen = np.cumsum([counts[value] for value in values])
    shares = {"p50": 0.5, "p99": 0.99, "p99_9": 0.999}
    out = {name: float(values[np.searchsorted(seen, share * seen[-1])]) for name, share in shares.items()}
    return out | {"largest": float(values[-1])}


def share_missed(counts: Counter[float], period_us: float, left_out: int | None = None) -> float:
    """Percentage of the periods that began more than a period late or never; where it is not known how many were left out,
    those that passed while one was late.
    """
    late = sum(count for lateness, count in counts.items() if lateness > period_us)
    passed = sum(count * int(lateness // period_us) for lateness, count in counts.items())
    never = passed if left_out is None else left_out
    return 100.0 * (late + never) / (sum(counts.values()) + never)


def stalls(counts: Counter[float], minutes: float) -> float:
    """How many a minute began more than 1 ms late."""
    return sum(count for lateness, count in counts.items() if lateness > STALL_US) / minutes


def at_rate(rate_hz: float, minutes: float, privileged: bool) -> dict[str, Any]:
    """Loop and cyclictest in turns at one rate, for so many minutes each."""
    bench = bench_at(rate_hz)
    times: dict[str, Counter[float]] = {name: Counter() for name in (*TIMES, "cyclictest")}
    counted: Counter[str] = Counter()
    periods = 0.0
    turns = max(1, round(60.0 * minutes / TURN_S))
    with tempfile.TemporaryDirectory() as name, busy_thread():
        for _ in range(turns):
            report, chunks = loop_turn(bench, Path(name), privileged)
            for kind, bins in report["histograms"].items():
                times[kind].update(dict(zip(bins["upper_edge_us"], bins["count"], strict=True)))
            periods += rate_hz * report["wall_s"]
            said = report["real_time"]
            counted.update({key: int(said[key]) for key in COUNTED if key in said})
            counted.update(overruns=report["overruns"], samples=report["samples"])
            times["cyclictest"].update(cyclictest_turn(rate_hz, chunks, bench, Path(name), privileged))
    out: dict[str, Any] = {f"{name}_us": quantiles(counts) for name, counts in times.items()}
    loop, other = out["wake_up_us"], out["cyclictest_us"]
    period_us, took_min = 1e6 / rate_hz, turns * TURN_S / 60.0
    out["wake_up_over_cyclictest"] = {key: loop[key] / max(1.0, other[key]) for key in loop}
    out["missed_percent"] = {
        "loop": share_missed(times["wake_up"], period_us, counted["skipped_periods"]),
        "cyclictest": share_missed(times["cyclictest"], period_us),
    }
    out["overrun_percent"] = 100.0 * counted["overruns"] / periods
    out["stall_ms"] = {"loop": 1e-3 * loop["largest"], "cyclictest": 1e-3 * other["largest"]}
    out["stalls_per_minute"] = {
        "loop": stalls(times["wake_up"], took_min),
        "cyclictest": stalls(times["cyclictest"], took_min),
        "handed_over": counted["stalls"] / took_min,
        "by_its_own_computing": counted["own_stalls"] / took_min,
    }
    out["in_the_loop"] = {key: float(counted[key]) for key in DISTURBANCES}
    return {**out, "samples": counted["samples"], "scheduling": said["scheduling"], "memory": said["memory"]}


def main(
    minutes: float = 2.0,
    rate: list[float] | None = None,
    unprivileged: bool = False,
    json: bool = False,
) -> None:
    """Measure loop and cyclictest for ``minutes`` at each ``rate`` (Hz)."""
    if shutil.which("cyclictest") is None:
        raise SystemExit("cyclictest is not installed (Debian: rt-tests)")
    show({f"{hertz:g} Hz": at_rate(hertz, minutes, not unprivileged) for hertz in rate or RATES_HZ}, json)


if __name__ == "__main__":
    typer.run(main)
