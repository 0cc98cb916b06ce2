"""A host of an emulated sound card in a process of its own, so that JACK's library can end no worker of the tests.

``python -m ... WHAT [FOLDER] < BENCH``: ``latency``, ``sine``, ``zeros``, ``calibrated`` or ``locked``; the answer is one line
of JSON.
"""

import json
import sys
from pathlib import Path

import numpy as np

import rig
from rig.bench import Bench
from rig.daq import LOST
from rig.drivers import make_daq
from rig.errors import DaqError
from tests.rig.emulator.calibrating import calibrated, latency_frames, phases_deg, plan


def latency(daq):
    """Where the latency comes from, its part behind queue and filters in frames."""
    return {"from": daq.identity["latency_from"], "frames": latency_frames(daq)}


def sine(daq):
    """Difference of what comes back through the cable from the sine that was put out, V, median over samples not lost."""
    block, rate_hz = daq.block, daq.sample_rate_hz
    rows, lost = [], []
    for number in range(300):
        instants = np.arange(number * block, (number + 1) * block)
        daq.continuation[0] = rate_hz / 100.0, 0.0
        rows.append(daq.exchange(np.sin(2.0 * np.pi * 100.0 * instants / rate_hz)))
        lost.append(daq.flags.copy())
    daq.exchange_zeros()
    read, at = np.concatenate(rows)[:, -1], np.arange(300 * block)
    good = (np.concatenate(lost) != LOST) & (at > 0.05 * rate_hz)
    expected = np.sin(2.0 * np.pi * 100.0 * (at - daq.latency_samples) / rate_hz)
    return {"median_v": float(np.median(np.abs(read - expected)[good]))}


def zeros(daq):
    """0 V until something ends it."""
    print("running", flush=True)
    while True:
        daq.exchange(np.zeros(daq.block))


def calibrated_(bench):
    """Corners that a calibration finds, and phases and latency by the bench that it writes, into the folder of an argument."""
    found, bench = calibrated(bench, Path(sys.argv[2]))
    with make_daq(bench) as daq:
        daq.start(bench.block)
        frames = latency_frames(daq)
    corners = [found.paths.output_high_pass_hz, *(one.high_pass_hz for one in found.paths.inputs)]
    return {"corners_hz": corners, "phases_deg": phases_deg(bench).tolist(), "frames": frames}


def locked(bench):
    """Points of a phase-locked test."""
    with rig.run(plan(), bench=bench) as run:
        points = list(run.recording.latest.values())
    kept = ("accepted", "reason", "force_n", "modal_frequency_hz", "damping_ratio", "phase_error_deg")
    return {"points": [{name: point.get(name) for name in kept} for point in points]}


def main():
    bench = Bench.model_validate_json(sys.stdin.readline())
    whole = {"calibrated": calibrated_, "locked": locked}.get(sys.argv[1])
    try:
        if whole is not None:
            said = whole(bench)
        else:
            with make_daq(bench) as daq:
                daq.start(bench.block)
                said = {"latency": latency, "sine": sine, "zeros": zeros}[sys.argv[1]](daq)
    except DaqError as error:
        said = {"error": type(error).__name__, "text": str(error)}
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
