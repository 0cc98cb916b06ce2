"""How fast the loop is, as ratios within one run: ``python -m benchmarks.loop [--json]``.

Everything runs on one core at 5 kHz with the shipped magnet-beam backbone (reading B of the paper's controller). Each
number is the median over interleaved rounds, so that what else the machine does falls on all of them alike.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import rig
from benchmarks.rk4 import arrays as rk4_arrays
from benchmarks.rk4 import kernels as rk4_kernels
from rig.bench import Bench, load_bench
from rig.campaigns.plans import load_plan
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ
from rig.tick.kernels import tick_block
from rig.tick.tick import Tick

ROUNDS = 9
SAMPLES = 40_000
BLOCKS = (1, 8, 64)
PLAN = "magnet-beam/backbone"


def _started(bench: Bench, block: int = 1) -> tuple[VirtualDAQ, Tick]:
    plan = load_plan(PLAN)
    daq = make_daq(bench)
    assert isinstance(daq, VirtualDAQ)
    daq.open()
    daq.start(block)
    lead = block + daq.latency_samples
    return daq, Tick(bench, plan.controller, plan.amplitude_law, plan.settle, plan.segments(bench.sample_rate_hz), lead)


def fused(bench: Bench) -> Callable[[], float]:
    """Tick and plant in one compiled loop, telemetry in memory: us per sample."""
    daq, tick = _started(bench)
    readings, rows = tick.buffers(SAMPLES)
    daq.run_fused(tick.arrays, readings[:10], rows[:10])

    def once() -> float:
        start = time.perf_counter()
        done = daq.run_fused(tick.arrays, readings, rows)
        return 1e6 * (time.perf_counter() - start) / done

    return once


def exchanged(bench: Bench, block: int) -> Callable[[], float]:
    """The same through `DAQ.exchange` in blocks: us per sample."""
    daq, tick = _started(bench, block)
    calls = SAMPLES // 4 // block
    readings, rows = tick.buffers(block)
    voltages = np.zeros(block)
    tick_block(tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages)

    def once() -> float:
        start = time.perf_counter()
        for _ in range(calls):
            tick_block(tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages)
        return 1e6 * (time.perf_counter() - start) / (calls * block)

    return once


def rk4(bench: Bench) -> Callable[[], float]:
    """The plant alone by the classic Runge-Kutta method with 8 sub-steps: us per sample."""
    daq, _ = _started(bench)
    arrays, state = rk4_arrays.build(daq.rig, substeps=8)
    out = np.zeros(state.outputs.size)
    voltages = 0.5 * np.sin(2 * np.pi * 24.4 * np.arange(SAMPLES) / bench.sample_rate_hz)
    truth = np.zeros((SAMPLES, out.size))
    rk4_kernels.run(arrays, state, voltages[:10], truth[:10])

    def once() -> float:
        start = time.perf_counter()
        rk4_kernels.run(arrays, state, voltages, truth)
        return 1e6 * (time.perf_counter() - start) / SAMPLES

    return once


def plant(bench: Bench) -> Callable[[], float]:
    """The virtual rig alone, sensors and converters included, without the tick: us per sample."""
    from simulators.kernels import run_open_loop

    daq, _ = _started(bench)
    arrays, state = daq.rig.build()
    voltages = 0.5 * np.sin(2 * np.pi * 24.4 * np.arange(SAMPLES) / bench.sample_rate_hz)
    out = np.zeros((SAMPLES, len(bench.channels)))
    run_open_loop(arrays, state, voltages[:10], out[:10])

    def once() -> float:
        start = time.perf_counter()
        run_open_loop(arrays, state, voltages, out)
        return 1e6 * (time.perf_counter() - start) / SAMPLES

    return once


def recorded(bench: Bench) -> Callable[[], float]:
    """A whole backbone test with journal and HDF5 file, start to end: us per sample."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            with rig.run(PLAN, bench=bench, output=Path(folder) / "run.h5") as run:
                return 1e6 * (time.perf_counter() - start) / run.recording.n_rows

    return once


def _seconds(*command: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


FIRST_SAMPLE = """
from benchmarks.loop import _started
from rig.bench import load_bench
daq, tick = _started(load_bench("magnet-beam"))
daq.run_fused(tick.arrays, *tick.buffers(1))
"""


def measure() -> dict[str, float]:
    """All numbers of one run."""
    bench = load_bench("magnet-beam")
    kinds = {"fused": fused(bench), "plant": plant(bench), "rk4": rk4(bench), "recorded": recorded(bench)}
    kinds |= {f"exchange_{block}": exchanged(bench, block) for block in BLOCKS}
    times: dict[str, list[float]] = {name: [] for name in kinds}
    for _ in range(ROUNDS):
        for name, once in kinds.items():
            times[name].append(once())
    us = {name: statistics.median(values) for name, values in times.items()}
    period_us = 1e6 / bench.sample_rate_hz
    out = {f"{name}_us_per_sample": value for name, value in us.items()}
    out |= {
        "fused_realtime_factor": period_us / us["fused"],
        "end_to_end_realtime_factor": period_us / us["recorded"],
        "rk4_plant_over_fused": us["rk4"] / us["fused"],
        "rk4_plant_over_plant": us["rk4"] / us["plant"],
    }
    out |= {f"exchange_{block}_over_fused": us[f"exchange_{block}"] / us["fused"] for block in BLOCKS}
    out["rig_help_s"] = statistics.median(
        _seconds("-c", "import sys; sys.argv = ['rig', '--help']; from rig.cli import main; main()") for _ in range(5)
    )
    out["warm_first_sample_s"] = statistics.median(_seconds("-c", FIRST_SAMPLE) for _ in range(5))
    return out


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    results = measure()
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, value in results.items():
            print(f"{name:32} {value:10.3f}")
