"""Latency by a channel that the output is connected to."""

import numpy as np
import pytest

from rig.check.run import check
from rig.conformance import with_loopback
from rig.drivers.virtual.driver import VirtualDAQ
from tests.rig.check.rewired import add_channel
from tests.rig.rigs import bench_with

LOOPBACK = {"name": "loop", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0, "loopback": True}


def delayed(samples: float):
    """The output late by a number of samples, linear between them."""
    whole, part = int(samples), samples % 1.0
    past = np.zeros(whole + 1)

    def column(first, voltages):
        known = np.concatenate([past, voltages])
        past[:] = known[len(known) - len(past) :]
        n = len(voltages)
        return (1.0 - part) * known[1 : 1 + n] + part * known[:n]

    return column


@pytest.mark.parametrize(("late", "verdict"), [(0.0, "ok"), (3.0, "fail")])
def test_a_loopback_tells_by_how_much_the_driver_is_wrong_about_its_latency(late, verdict, tmp_path, monkeypatch):
    bench = bench_with({"block": 50, "channels": [*bench_with().model_dump()["channels"], LOOPBACK]})
    plain = bench_with({"block": 50})
    daq = VirtualDAQ(plain)
    add_channel(monkeypatch, delayed(daq.latency_samples + late))
    found = check(bench, tmp_path / "check.h5")
    latency = next(f for f in found.findings if f.name == "latency")
    assert latency.verdict == verdict
    assert latency.value == pytest.approx(late, abs=0.02)


def test_the_loopback_of_a_virtual_rig_agrees_with_its_driver(tmp_path):
    found = check(with_loopback(bench_with({"block": 50}, queue_blocks=1)), tmp_path / "check.h5")
    latency = next(f for f in found.findings if f.name == "latency")
    assert latency.verdict == "ok"
    assert latency.value == pytest.approx(0.0, abs=0.02)
