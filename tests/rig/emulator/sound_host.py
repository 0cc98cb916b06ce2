"""A host of an emulated sound card in a process of its own, so that JACK's library can end no worker of the tests.

``python -m ... WHAT < BENCH``: ``latency``, ``sine`` or ``zeros``; the answer is one line of JSON.
"""

import json
import sys

import numpy as np

from rig.bench import Bench
from rig.daq import LOST
from rig.drivers import make_daq
from rig.errors import DaqError
from tests.rig.emulator.calibrating import latency_frames


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


def main():
    bench = Bench.model_validate_json(sys.stdin.readline())
    try:
        with make_daq(bench) as daq:
            daq.start(bench.block)
            said = {"latency": latency, "sine": sine, "zeros": zeros}[sys.argv[1]](daq)
    except DaqError as error:
        said = {"error": type(error).__name__, "text": str(error)}
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
