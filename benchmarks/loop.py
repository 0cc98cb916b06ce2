"""How fast the loop is, as ratios within one run: ``python -m benchmarks.loop [--json]``.

Everything runs on one core at 5 kHz with the shipped backbones (reading B of the paper's controller): both shipped rigs, and
for reference the magnet beam with two sub-steps and no filter, whose kernels do nothing but its physics. Each number is the
median over interleaved rounds, so that what else the machine does falls on all of them alike; ``least`` is the quickest
round, what the code costs on a machine that is left alone.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import typer

import rig
from benchmarks.frame import in_turn, on_one_core, show
from rig.bench import Bench, load_bench
from rig.campaigns.plans import load_plan
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ
from rig.tick.kernels import tick_block
from rig.tick.tick import Tick, TickSettings
from simulators.kernels import RigArrays, RigState, advance, run_open_loop
from vibrolock.arrays import Float
from vibrolock.compiled import bound, kernel

ROUNDS = 9
"""Measurements of each kind, of which the median counts; chosen."""
SAMPLES = 40_000
"""Samples of a measurement, 8 s at 5 kHz."""
BLOCKS = (1, 8, 64)
"""Samples a block of the exchange."""
DRIVE = {"magnet-beam": (0.5, 24.4), "friction-beam": (0.5, 149.0)}
"""Voltage (V) and frequency (Hz) of the open-loop measurements."""
NO_FILTER = "magnet-beam, 2 sub-steps, no filter"


def benches() -> dict[str, Bench]:
    """What is measured, by its name in the results."""
    shipped = {name: load_bench(name) for name in DRIVE}
    table = shipped["magnet-beam"].model_dump()
    table["driver"]["options"]["converter"] = {"substeps": 2, "oversampling": 1, "anti_alias_hz": 0.0}
    return shipped | {NO_FILTER: Bench.model_validate(table)}


def started(bench: Bench, block: int = 1) -> tuple[VirtualDAQ, Tick]:
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
        daq, tick = started(bench)  # from rest each time: the plan must not come to its end
        readings, rows = tick.buffers(SAMPLES)
        daq.run_fused(tick.arrays, readings[:10], rows[:10])
        start = time.perf_counter()
        done = daq.run_fused(tick.arrays, readings, rows)
        return 1e6 * (time.perf_counter() - start) / done

    return once


def exchanged(bench: Bench, block: int) -> Callable[[], float]:
    """The same through `DAQ.exchange` in blocks, with the tick bound to its arguments as in a loop: us per sample."""
    daq, tick = started(bench, block)
    readings, rows = tick.buffers(block)
    voltages = np.zeros(block)

    told = daq.put_out, daq.continuation
    once_bound = bound(tick_block, tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages, *told)

    def run(calls: int) -> None:
        for _ in range(calls):
            once_bound(tick.arrays, daq.exchange(voltages), daq.flags, readings, rows, voltages, *told)

    def once() -> float:
        calls = SAMPLES // 4 // block
        start = time.perf_counter()
        run(calls)
        return 1e6 * (time.perf_counter() - start) / (calls * block)

    run(1)
    return once


def open_loop(bench: Bench, run: Callable[[np.ndarray], object]) -> Callable[[], float]:
    """A plant without the tick, driven by a sine: us per sample."""
    volts, frequency_hz = DRIVE[bench.name]
    voltages = volts * np.sin(2 * np.pi * frequency_hz * np.arange(SAMPLES) / bench.sample_rate_hz)
    run(voltages[:10])

    def once() -> float:
        start = time.perf_counter()
        run(voltages)
        return 1e6 * (time.perf_counter() - start) / voltages.size

    return once


@kernel
def integrate(rig: RigArrays, state: RigState, voltages: Float, internal: int) -> int:
    """``internal`` calls of `advance` per voltage; returns all flags, or-ed."""
    flags = 0
    for k in range(voltages.size):
        for _ in range(internal):
            flags |= advance(rig, state, voltages[k])
    return flags


def open_loops(bench: Bench) -> dict[str, Callable[[], float]]:
    """The plant with sensors and converters, and alone by its integrator."""
    virtual = started(bench)[0].rig
    whole, plant = virtual.build(), virtual.build()
    out, internal = np.zeros((SAMPLES, len(bench.channels))), virtual.converter.oversampling
    return {
        "rig": open_loop(bench, lambda voltages: run_open_loop(*whole, voltages, out)),
        "integrator": open_loop(bench, lambda voltages: integrate(*plant, voltages, internal)),
    }


def recorded(bench: Bench) -> Callable[[], float]:
    """A whole backbone test with journal and HDF5 file, start to end: us per sample."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            with rig.run(f"{bench.name}/backbone", bench=bench, output=Path(folder) / "run.h5") as run:
                return 1e6 * (time.perf_counter() - start) / run.recording.n_rows

    return once


def measure() -> dict[str, dict[str, float]]:
    """All numbers of all benches."""
    work: dict[str, dict[str, Callable[[], float]]] = {
        name: {"fused": fused(bench), **open_loops(bench)}
        | {f"exchange_{block}": exchanged(bench, block) for block in BLOCKS}
        | {"recorded": recorded(bench)}
        for name, bench in benches().items()
    }
    return {name: numbers(in_turn(work[name], ROUNDS), 1e6 / bench.sample_rate_hz) for name, bench in benches().items()}


def numbers(times: dict[str, list[float]], period_us: float) -> dict[str, float]:
    """What the times (us per sample) of one bench come to."""
    us = {kind: statistics.median(values) for kind, values in times.items()}
    return {
        **{f"{kind}_us_per_sample": value for kind, value in us.items()},
        **{f"{kind}_least_us_per_sample": min(values) for kind, values in times.items()},
        "fused_realtime_factor": period_us / us["fused"],
        "integrator_realtime_factor": period_us / us["integrator"],
        "share_of_integrator": us["integrator"] / us["fused"],
        "share_of_sensors": (us["rig"] - us["integrator"]) / us["fused"],
        "share_of_tick": (us["fused"] - us["rig"]) / us["fused"],
        "end_to_end_realtime_factor": period_us / us["recorded"],
        "end_to_end_over_fused": us["fused"] / us["recorded"],
        "end_to_end_over_fused_least": min(times["fused"]) / min(times["recorded"]),
        "beside_the_loop_us_per_sample": us["recorded"] - us["fused"],
        **{f"exchange_{block}_over_fused": us[f"exchange_{block}"] / us["fused"] for block in BLOCKS},
    }


HELP = "import sys; sys.argv = ['rig', '--help']; from rig.cli import main; main()"
FIRST_SAMPLE = """
from benchmarks.loop import started
from rig.bench import load_bench
daq, tick = started(load_bench("magnet-beam"))
daq.run_fused(tick.arrays, *tick.buffers(1))
"""


def starting() -> dict[str, float]:
    """Seconds until something happens."""

    def seconds(code: str) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start

    codes = {"rig_help_s": HELP, "warm_first_sample_s": FIRST_SAMPLE}
    return {name: statistics.median(seconds(code) for _ in range(5)) for name, code in codes.items()}


def main(json: bool = False) -> None:
    """Measure and print how fast the loop is."""
    on_one_core()
    show(measure() | {"starting": starting()}, json)


if __name__ == "__main__":
    typer.run(main)
