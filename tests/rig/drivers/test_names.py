"""Drivers by name: the shipped ones are always those, others come from installed packages."""

import sys

import pytest

from rig.drivers import driver_names, make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError
from tests.refused import refused
from tests.rig.rigs import bench_with


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package on the path with a driver of its own and one that takes the name of a shipped one."""
    info = tmp_path / "box-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: box\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[vibrolock.drivers]\nbox = box:BoxDAQ\nvirtual = box:BoxDAQ\n")
    (tmp_path / "box.py").write_text(
        "from rig.drivers.virtual import VirtualDAQ\n\n\nclass BoxDAQ(VirtualDAQ):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("box", None)


def test_a_driver_of_an_installed_package_is_found(installed):
    assert driver_names() == ["box", "can", "nidaqmx", "serial", "sound", "virtual"]
    bench = bench_with()
    named = bench.model_copy(update={"driver": bench.driver.model_copy(update={"name": "box"})})
    assert type(make_daq(named)).__name__ == "BoxDAQ"


def test_a_package_does_not_take_the_name_of_a_shipped_driver(installed):
    assert type(make_daq(bench_with())) is VirtualDAQ


def test_an_unknown_name_is_refused_with_those_there_are(installed):
    bench = bench_with()
    named = bench.model_copy(update={"driver": bench.driver.model_copy(update={"name": "bocks"})})
    with refused(ConfigurationError, "bocks-box-can-nidaqmx-serial-sound-virtual", field="driver.name", value="bocks"):
        make_daq(named)
