"""The driver that is printed on the page for driver authors passes the contract, and its own promises."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rig.bench import Bench, load_bench
from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers import driver_names, make_daq
from rig.errors import ConfigurationError, DaqDisconnected, DaqRefused
from tests.docs.pages import ROOT, blocks, write
from tests.hardware.projects import FORKED_PYTEST
from tests.refused import refused

FOLDER: list[Path] = []


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory):
    """The page's files in a folder on the import path, with its entry point as an installer would leave it."""
    folder = tmp_path_factory.mktemp("box")
    for block in blocks(ROOT / "docs" / "tutorials" / "a-driver.md"):
        if block.file:
            write(block, folder)
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    FOLDER[:] = [folder]
    yield
    sys.path.remove(str(folder))
    sys.modules.pop("box_driver", None)


def bench(**changes) -> Bench:
    table = load_bench(FOLDER[0] / "box-bench.toml").model_dump()
    return Bench.model_validate(table | changes)


class TestBoxOfThePage(DriverContract):
    def make(self) -> DAQ:
        return make_daq(bench())


def test_the_driver_of_the_page_is_found_by_its_entry_point():
    assert "box" in driver_names()
    assert type(make_daq(bench())).__name__ == "BoxDAQ"


@pytest.mark.slow
def test_the_tests_of_the_page_pass_and_pull_the_cable():
    command = [sys.executable, *FORKED_PYTEST, "-q", "-rs", "-p", "no:cacheprovider", "test_box.py"]
    path = os.pathsep.join([str(FOLDER[0]), str(ROOT)])
    env = {**os.environ, "PYTHONPATH": path, "PYTEST_ADDOPTS": ""}
    done = subprocess.run(command, cwd=FOLDER[0], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "unplug" not in done.stdout


def test_an_unplugged_box_is_disconnected_and_still_closes():
    daq = make_daq(bench())
    with daq:
        daq.start(4)
        device = daq.device
        device.plugged = False
        with refused(DaqDisconnected, "serial-number"):
            daq.exchange(np.full(4, 0.05))
    assert device.output_v == 0.0


def test_a_rate_beyond_the_box_is_refused_at_open_with_the_numbers():
    with refused(DaqRefused, "samples-s-asked-for-it-takes"):
        make_daq(bench(sample_rate_hz=50000.0)).open()


def test_an_option_that_is_missing_is_named():
    with refused(ConfigurationError, "driver-options-serial-number-is-missing", field="serial_number"):
        make_daq(bench(driver={"name": "box"}))


def test_the_latency_that_the_driver_names_is_the_one_of_a_sine():
    daq = make_daq(bench())
    rate, frequency, count = daq.sample_rate_hz, 25.0, 4000
    phase = 2.0 * np.pi * frequency / rate * np.arange(count)
    with daq:
        daq.start(4)
        inputs = np.vstack([daq.exchange(v) for v in (0.05 * np.cos(phase)).reshape(-1, 4)])[-2000:, 0]
    lag = -np.angle(np.sum(inputs * np.exp(-1j * phase[-2000:])))
    assert lag / (2.0 * np.pi * frequency / rate) == pytest.approx(daq.latency_samples, abs=0.005)
