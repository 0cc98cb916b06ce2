"""A backbone by the clock whose loop is stopped again and again: ``python -m benchmarks.stopped_worker [--stops 67]``.

The process of the loop is stopped (SIGSTOP) for 20, 50 and 90 ms at random instants, ``--stops`` times each in a run over an
emulated serial device with a watchdog of 0.1 s. A loopback channel of the device is the witness. Of each run: points accepted,
attempts refused, samples continued and held, the largest deviation of the output from what the host would have put out, over
its amplitude, and of the loopback from the recorded output. Then once for 0.3 s: the watchdog, and the output after it.
"""

import os
import random
import signal
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import typer

import rig
from benchmarks.frame import show
from benchmarks.outcomes import PLAN, outcome
from rig.bench import load_bench
from rig.conformance import with_loopback
from rig.emulator.emulated import emulated
from rig.errors import RigError
from rig.tick.layout import DEVICE_SHIFT

RUN_S = 62.0
"""Length of the run, s."""
BEGIN_S = 6.0
"""When the first stop may come, s."""
PAST_THE_WATCHDOG_S = 0.3
"""Length of the stop that the watchdog ends, s."""


def workers() -> list[int]:
    """Numbers of the loop's processes of this one."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((path / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == os.getpid() and b"rig.loop.worker" in (path / "cmdline").read_bytes():
                found.append(int(path.name))
        except OSError:
            continue
    return found


def stop_again(done: threading.Event, stops: int, seconds: float, seed: int) -> None:
    """Stop the loop's process so many times at random instants of the run, for so long each time."""
    draw = random.Random(seed)
    time.sleep(BEGIN_S)
    for _ in range(stops):
        if done.wait(draw.uniform(0.5, 1.5) * (RUN_S - BEGIN_S) / stops - seconds):
            return
        for number in workers():
            os.kill(number, signal.SIGSTOP)
            time.sleep(seconds)
            os.kill(number, signal.SIGCONT)


def run_once(seconds: float, stops: int, seed: int) -> dict[str, Any]:
    """One run; what came of it."""
    done = threading.Event()
    bench = with_loopback(load_bench("magnet-beam").model_copy(update={"block": 10}))
    stopper = threading.Thread(target=stop_again, args=(done, stops, seconds, seed))
    with TemporaryDirectory() as folder, ExitStack() as stack:
        log = Path(folder) / "output.log"
        reached = stack.enter_context(emulated(bench, "serial", lockstep=False, log_output=log))
        stopper.start()
        try:
            with rig.run(PLAN, bench=reached, seed=seed) as run:
                last_v = float(log.read_text().split()[-1])
                rate_hz = bench.sample_rate_hz
                return {"stops": stops, **outcome(run), **deviations(run, rate_hz), "output at the end, V": last_v}
        except RigError as error:
            return {"stops": stops, "ended": str(error)}
        finally:
            done.set()
            stopper.join()


def deviations(run: rig.Run, rate_hz: float) -> dict[str, float]:
    """Return how far outputs that the device put out by itself, and those that the witness saw, are from what was meant."""
    part = run.recording.parts[0]
    names = ("output_v", "theta_rad", "command_v", "flags", "frequency_hz")
    rows = {name: part.rows(name, 0, part.n_rows) for name in names}
    output, part_of_sample = rows["output_v"].astype(float), part.information["about"]["lead_samples"] % 1.0
    turn = 2.0 * np.pi * part_of_sample / rate_hz * rows["frequency_hz"].astype(float)  # to the whole sample
    meant = np.real(rows["command_v"] * np.exp(1j * (rows["theta_rad"].astype(float) + turn)))
    flags = rows["flags"] >> DEVICE_SHIFT
    continued = (flags & 32) != 0
    size = np.maximum(np.abs(rows["command_v"]), 1e-3)
    loopback = part.rows("inputs", 0, part.n_rows)[:, -1]
    seen = (1.0 - part_of_sample) * output[1:] + part_of_sample * output[:-1]
    off = np.abs(output - meant)[continued] / size[continued]
    return {
        "deviation_percent": 100.0 * float(off.max(initial=0.0)),
        "usual_percent": 100.0 * float(np.median(off)) if off.size else 0.0,
        "witness_v": float(np.nanmax(np.abs(loopback[1:] - seen))),
    }


def main(stops: int = 67) -> None:
    """Stop the loop so often in each run."""
    for number, seconds in enumerate((0.020, 0.050, 0.090)):
        show({f"{1e3 * seconds:.0f} ms": run_once(seconds, stops, number)})
    show({"past the watchdog": run_once(PAST_THE_WATCHDOG_S, 1, 3)})


if __name__ == "__main__":
    typer.run(main)
