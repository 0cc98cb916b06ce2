"""What is installed: the names, and what a wheel contains."""

import subprocess
import sys
import zipfile
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("rig", "controller", "simulators", "identification", "vibrolock")


@pytest.mark.parametrize("name", PACKAGES)
def test_the_package_is_this_distribution_and_no_other(name):
    file = import_module(name).__file__
    assert file is not None
    assert Path(file).parent.parent == ROOT
    assert set(packages_distributions().get(name, ["vibrolock"])) == {"vibrolock"}


def test_a_wheel_holds_benches_plans_specimens_the_page_and_type_markers(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path), str(ROOT)], check=True
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    for wanted in (
        "rig/bench/shipped/magnet-beam.toml",
        "rig/campaigns/shipped/magnet-beam/backbone.toml",
        "rig/campaigns/shipped/magnet-beam-symmetric/backbone.toml",
        "simulators/specimens/magnet-beam.toml",
        "rig/monitor/page/index.html",
        *(f"{package}/py.typed" for package in PACKAGES),
    ):
        assert wanted in names
    assert not [name for name in names if name.startswith(("tests/", "benchmarks/", "docs/"))]
