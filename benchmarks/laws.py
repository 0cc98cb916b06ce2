"""What a sample of the tick costs with each control law, beside the simplest one: ``python -m benchmarks.laws [--json]``.

The tick alone, without a rig behind it: the inputs are those of a run of the same law on the virtual rig, so that every
branch is taken as in a test. All laws are timed in turn in the same rounds on one core; the ratios are those of the medians.
"""

import json
import math
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from controller import AmplitudeLaw, PhaseLockedLoop, preset
from rig.bench import Bench, load_bench
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ
from rig.tick.kernels import tick_block
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick

ROUNDS = 11
SAMPLES = 40_000
SIMPLEST = "two-phase, phase PI, voltage (the paper's)"
SETTINGS: dict[str, dict[str, Any]] = {
    # bench: voltage to begin with, response level (m), force level (N), pole (rad/s) and gain of the plant, share of w_LP
    "magnet-beam": {
        "start_v": 0.3,
        "level_m": 1e-3,
        "level_n": 0.25,
        "pole": (-11.5, 3.9),
        "share": 8.0,
        "gain": (-5.42, 14.8),
    },
    "friction-beam": {
        "start_v": 0.3,
        "level_m": 1e-4,
        "level_n": 5.0,
        "pole": (-5.8, -24.3),
        "share": 12.0,
        "gain": (196.0, 31.0),
    },
}


def laws(bench: Bench) -> dict[str, tuple[PhaseLockedLoop, AmplitudeLaw, float]]:
    """What is measured: for each name the law, and what it holds."""
    facts, f0 = SETTINGS[bench.name], bench.specimen.linear_frequency_hz
    corner = 2.0 * math.pi * f0 / 5.0
    paper = preset("magnet-beam" if bench.name == "magnet-beam" else "friction-beam")
    window = (0.9 * f0, 1.1 * f0)
    adaptive = {
        "detector": "adaptive",
        "low_pass_rad_s": corner,
        "centre_frequency_hz": f0,
        "frequency_window_hz": window,
    }
    error = {"frequency_law": "frequency-error", "frequency_integral_per_s": corner / facts["share"]}
    response = {"response_integral_per_s": corner / 4.0, "plant_pole_rad_s": facts["pole"]}
    through = {"force_loop": "through-response", "reference_integral_per_s": corner / 12.0}
    rest = {"rest_low_pass_rad_s": 2.0 * corner, "plant_gain_per_v": facts["gain"]}
    volts = (AmplitudeLaw.VOLTAGE, facts["start_v"])
    return {
        SIMPLEST: (paper, *volts),
        "adaptive filter (H = 5), phase PI": (PhaseLockedLoop(**adaptive, k1=1.0, k2=10.0), *volts),
        "adaptive filter, frequency error": (PhaseLockedLoop(**adaptive, **error), *volts),
        "the same with complex response control": (
            PhaseLockedLoop(**adaptive, **error, **response),
            AmplitudeLaw.RESPONSE,
            facts["level_m"],
        ),
        "the same with the force held through the response": (
            PhaseLockedLoop(**adaptive, **error, **response, **through),
            AmplitudeLaw.FORCE,
            facts["level_n"],
        ),
        "all of it: by the force at rest, RMS held, H = 12": (
            PhaseLockedLoop(**adaptive, **error, **response, **through, **rest, harmonics_followed=12),
            AmplitudeLaw.FORCE_RMS,
            facts["level_n"] / math.sqrt(2.0),
        ),
    }


def _tick(bench: Bench, daq: VirtualDAQ, law: PhaseLockedLoop, amplitude_law: AmplitudeLaw, level: float) -> Tick:
    volts = AmplitudeLaw.VOLTAGE
    start = SETTINGS[bench.name]["start_v"]
    segments = [
        Segment(SegmentKind.RAMP, -1, start, 10.0, amplitude_law=volts),
        Segment(SegmentKind.HOLD, -1, start, 40.0, amplitude_law=volts),
        Segment(SegmentKind.RAMP, -1, level, 20.0, geometric=True),
        Segment(SegmentKind.HOLD, -1, level, 1e6),
    ]
    return Tick(bench, law, amplitude_law, SettleRule(), segments, daq.block + daq.latency_samples)


def cost(bench: Bench, law: PhaseLockedLoop, amplitude_law: AmplitudeLaw, level: float) -> Callable[[], float]:
    """The tick alone over the inputs of a run: us per sample."""
    daq = make_daq(bench)
    assert isinstance(daq, VirtualDAQ)
    daq.open()
    daq.start(1)
    tick = _tick(bench, daq, law, amplitude_law, level)
    readings, rows = tick.buffers(SAMPLES)
    done = daq.run_fused(tick.arrays, readings, rows)
    assert done == SAMPLES, "the run has ended before its time"
    volts = readings * np.array([channel.sensitivity_v_per_unit for channel in bench.channels])
    flags, outputs, put_out = np.zeros(SAMPLES, daq.flags.dtype), np.empty(SAMPLES), np.full(SAMPLES, np.nan)
    told = daq.continuation

    def once() -> float:
        again = _tick(bench, daq, law, amplitude_law, level)
        tick_block(again.arrays, volts[:10], flags[:10], readings[:10], rows[:10], outputs[:10], put_out[:10], told)
        start = time.perf_counter()
        tick_block(again.arrays, volts, flags, readings, rows, outputs, put_out, told)
        return 1e6 * (time.perf_counter() - start) / SAMPLES

    return once


def measure() -> dict[str, dict[str, dict[str, float]]]:
    """Cost of every law on every bench, and its ratio to the simplest."""
    out = {}
    for name in SETTINGS:
        bench = load_bench(name)
        kinds = {label: cost(bench, *settings) for label, settings in laws(bench).items()}
        times: dict[str, list[float]] = {label: [] for label in kinds}
        for _ in range(ROUNDS):
            for label, once in kinds.items():
                times[label].append(once())
        us = {label: statistics.median(values) for label, values in times.items()}
        out[name] = {
            label: {
                "us_per_sample": us[label],
                "least_us": min(times[label]),
                "over_simplest": us[label] / us[SIMPLEST],
            }
            for label in kinds
        }
    return out


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    results = measure()
    if "--json" in sys.argv:
        print(json.dumps(results, indent=2))
    else:
        for name, costs in results.items():
            print(name)
            for label, values in costs.items():
                print(f"  {label:52} {values['us_per_sample']:7.3f} us  {values['over_simplest']:6.2f} x")
