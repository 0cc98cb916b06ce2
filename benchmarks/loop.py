"""How fast the loop is, as ratios within one run: ``python -m benchmarks.loop [--json]``.

Everything runs on one core at 5 kHz with the shipped backbones (reading B of the paper's controller): both shipped rigs, and
for reference the magnet beam with two sub-steps and no filter, whose kernels do nothing but its physics. Each number is the
median over interleaved rounds, so that what else the machine does falls on all of them alike; ``least`` is the quickest
round, what the code costs on a machine that is left alone.
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
from benchmarks.integrator import kernels as integrator_kernels
from benchmarks.rk4 import arrays as rk4_arrays, kernels as rk4_kernels
from rig.bench import Bench, load_bench
from rig.campaigns.plans import load_plan
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ
from rig.tick.kernels import tick_block
from rig.tick.tick import Tick, TickSettings
from simulators.kernels import run_open_loop

ROUNDS = 9
SAMPLES = 40_000
BLOCKS = (1, 8, 64)
DRIVE = {"magnet-beam": (0.5, 24.4), "friction-beam": (0.5, 149.0)}  # V and Hz of the open-loop measurements
NO_FILTER = "magnet-beam, 2 sub-steps, no filter"


def benches() -> dict[str, Bench]:
    """What is measured, by its name in the results."""
    shipped = {name: load_bench(name) for name in DRIVE}
    table = shipped["magnet-beam"].model_dump()
    table["driver"]["options"]["converter"] = {"substeps": 2, "oversampling": 1, "anti_alias_hz": 0.0}
    return shipped | {NO_FILTER: Bench.model_validate(table)}


def _started(bench: Bench, block: int = 1) -> tuple[VirtualDAQ, Tick]:
    plan = load_plan(f"{bench.name}/backbone")
    daq = make_daq(bench)
    assert isinstance(daq, VirtualDAQ)
    daq.open()
    daq.start(block)
    lead = block + daq.latency_samples
    return daq, Tick(
        TickSettings(bench, plan.controller, plan.amplitude_law, plan.settle, plan.segments(bench.sample_rate_hz)), lead
    )


def fused(bench: Bench) -> Callable[[], float]:
    """Tick and plant in one compiled loop, telemetry in memory: us per sample."""

    def once() -> float:
        daq, tick = _started(bench)  # from rest each time: the plan must not come to its end
        readings, rows = tick.buffers(SAMPLES)
        daq.run_fused(tick.arrays, readings[:10], rows[:10])
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
    tick_block(tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages, daq.put_out, daq.continuation)

    def once() -> float:
        start = time.perf_counter()
        for _ in range(calls):
            tick_block(
                tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages, daq.put_out, daq.continuation
            )
        return 1e6 * (time.perf_counter() - start) / (calls * block)

    return once


def _sine(bench: Bench) -> np.ndarray:
    volts, frequency_hz = DRIVE[bench.name]
    return np.asarray(volts * np.sin(2 * np.pi * frequency_hz * np.arange(SAMPLES) / bench.sample_rate_hz))


def _timed(run: Callable[[np.ndarray], object], voltages: np.ndarray) -> Callable[[], float]:
    run(voltages[:10])

    def once() -> float:
        start = time.perf_counter()
        run(voltages)
        return 1e6 * (time.perf_counter() - start) / voltages.size

    return once


def rk4(bench: Bench) -> Callable[[], float]:
    """The plant alone by the classic Runge-Kutta method with 8 sub-steps: us per sample."""
    daq, _ = _started(bench)
    arrays, state = rk4_arrays.build(daq.rig, substeps=8)
    truth = np.zeros((SAMPLES, state.outputs.size))
    return _timed(lambda voltages: rk4_kernels.run(arrays, state, voltages, truth), _sine(bench))


def integrator(bench: Bench) -> Callable[[], float]:
    """The plant alone, without sensors and converters: us per sample."""
    daq, _ = _started(bench)
    arrays, state = daq.rig.build()
    internal = daq.rig.converter.oversampling
    return _timed(lambda voltages: integrator_kernels.run(arrays, state, voltages, internal), _sine(bench))


def virtual_rig(bench: Bench) -> Callable[[], float]:
    """The virtual rig, sensors and converters included, without the tick: us per sample."""
    daq, _ = _started(bench)
    arrays, state = daq.rig.build()
    out = np.zeros((SAMPLES, len(bench.channels)))
    return _timed(lambda voltages: run_open_loop(arrays, state, voltages, out), _sine(bench))


def recorded(bench: Bench) -> Callable[[], float]:
    """A whole backbone test with journal and HDF5 file, start to end: us per sample."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            with rig.run(f"{bench.name}/backbone", bench=bench, output=Path(folder) / "run.h5") as run:
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


def measure() -> dict[str, dict[str, float]]:
    """All numbers of all benches."""
    measured = {}
    for name, bench in benches().items():
        kinds = {"fused": fused(bench), "rig": virtual_rig(bench), "integrator": integrator(bench), "rk4": rk4(bench)}
        kinds |= {f"exchange_{block}": exchanged(bench, block) for block in BLOCKS}
        kinds["recorded"] = recorded(bench)
        measured[name] = kinds
    times: dict[str, dict[str, list[float]]] = {name: {kind: [] for kind in measured[name]} for name in measured}
    for _ in range(ROUNDS):
        for name, kinds in measured.items():
            for kind, once in kinds.items():
                times[name][kind].append(once())
    return {name: numbers(times[name], 1e6 / bench.sample_rate_hz) for name, bench in benches().items()}


def numbers(times: dict[str, list[float]], period_us: float) -> dict[str, float]:
    """What the times (us per sample) of one bench come to."""
    us = {kind: statistics.median(values) for kind, values in times.items()}
    out = {f"{kind}_us_per_sample": value for kind, value in us.items()}
    out |= {f"{kind}_least_us_per_sample": min(values) for kind, values in times.items()}
    out |= {
        "fused_realtime_factor": period_us / us["fused"],
        "integrator_realtime_factor": period_us / us["integrator"],
        "rk4_over_integrator": us["rk4"] / us["integrator"],
        "rk4_over_fused": us["rk4"] / us["fused"],
        "share_of_integrator": us["integrator"] / us["fused"],
        "share_of_sensors": (us["rig"] - us["integrator"]) / us["fused"],
        "share_of_tick": (us["fused"] - us["rig"]) / us["fused"],
    }
    out |= {
        "end_to_end_realtime_factor": period_us / us["recorded"],
        "end_to_end_over_fused": us["fused"] / us["recorded"],
        "end_to_end_over_fused_least": min(times["fused"]) / min(times["recorded"]),
        "beside_the_loop_us_per_sample": us["recorded"] - us["fused"],
    }
    return out | {f"exchange_{block}_over_fused": us[f"exchange_{block}"] / us["fused"] for block in BLOCKS}


def starting() -> dict[str, float]:
    """Seconds until something happens."""
    return {
        "rig_help_s": statistics.median(
            _seconds("-c", "import sys; sys.argv = ['rig', '--help']; from rig.cli import main; main()")
            for _ in range(5)
        ),
        "warm_first_sample_s": statistics.median(_seconds("-c", FIRST_SAMPLE) for _ in range(5)),
    }


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    results = measure() | {"starting": starting()}
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, values in results.items():
            print(name)
            for key, value in values.items():
                print(f"  {key:36} {value:10.3f}")
