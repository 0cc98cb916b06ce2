"""Measurements in a loop process at 0 V: how late it is woken, and how quickly a device answers."""

import gc
import time
from typing import Any

import numpy as np

from rig.bench import Bench
from rig.drivers import make_daq
from rig.errors import DaqError
from rig.loop.worker.histogram import Histogram
from rig.loop.worker.pace import HostPace, pacing_of
from rig.system.privileges import prepare

__all__ = ["probe", "round_trips"]

SETTLE_BLOCKS = 10


def probe(rate_hz: float, seconds: float, privileged: bool) -> dict[str, Any]:
    """Measure the lateness of wake-ups at a rate (Hz); return it with the privileges that were granted."""
    said = prepare(privileged=privileged)
    histogram = Histogram()
    pace = HostPace(1.0 / rate_hz)
    pace.begin()
    for _ in range(round(rate_hz * seconds)):
        now = pace.wait()
        histogram.add(now - pace.release(now))
    gc.enable()
    return {"wake_up_us": histogram.report(), **said}


def round_trips(bench: Bench, seed: int, seconds: float) -> dict[str, Any]:
    """Open a bench's device, exchange blocks of 0 V with it for some seconds, and return the timing.

    ``block_us``: time between two blocks; ``rate_hz``: samples received per second; ``statistics``: measurements of the driver
    itself. No blocks are exchanged with a device that has something ``latched``.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError`.
    """
    with make_daq(bench, seed) as daq:
        capabilities = daq.capabilities
        out: dict[str, Any] = {
            "driver": bench.driver.name,
            "identity": dict(daq.identity),
            "sample_rate_hz": bench.sample_rate_hz,
            "block": bench.block,
            "largest_block": capabilities.largest_block,
            "paced_by": pacing_of(daq),
            "virtual": capabilities.virtual,
        }
        if daq.latched:  # nobody has armed the bench, so nothing may be cleared
            return out | {"latched": daq.latched, "remarks": [*daq.remarks]}
        prepare(privileged=out["paced_by"] == "device")  # else the loop would hog the processor
        daq.start(bench.block)
        zeros = np.zeros(bench.block)
        for _ in range(SETTLE_BLOCKS):
            daq.exchange(zeros)
        histogram, samples = Histogram(), 0
        began = before = time.monotonic_ns()
        failure = ""
        try:
            while before - began < 1e9 * seconds:
                daq.exchange(zeros)
                now = time.monotonic_ns()
                histogram.add(now - before)
                before, samples = now, samples + bench.block
        except DaqError as error:
            failure = f"{type(error).__name__}: {error}"
        out |= {"block_us": histogram.report(), "latency_samples": daq.latency_samples}
        out["reached_hz"] = round(1e9 * samples / max(1, before - began), 1)
        out |= {"failure": failure} if failure else {}
        out |= {"statistics": dict(daq.statistics), "counters": dict(daq.counters)}
        out["remarks"] = [*daq.remarks]
        return out
