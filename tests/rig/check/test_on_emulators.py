"""The check over real lines: an emulated device in order, and two whose cables and sensors are not as the bench has them."""

import pytest

from rig.check.run import check
from rig.emulator.emulated import emulated
from tests.rig.rigs import bench_with

SLOW = {"block": 800}  # fewer turns on the line: nothing of a check is in a hurry


@pytest.mark.parametrize(
    ("wire", "wrong", "failed"),
    [
        ("serial", {}, ()),
        ("serial", {"dead": ("acc_drive",), "flip": ("acc_magnet",)}, ("life acc_drive", "polarity acc_magnet")),
        ("can", {"swap": (("drive", "acc_magnet"),)}, ("place drive", "place acc_magnet")),
    ],
)
def test_what_is_wrong_with_the_device_is_named_and_nothing_else(wire, wrong, failed, tmp_path):
    with emulated(bench_with(SLOW), wire, seed=3, **wrong) as bench:
        found = check(bench, tmp_path / "check.h5")
    assert found.failed == failed
    assert found.level_rms_v is not None
    assert {finding.verdict for finding in found.findings if finding.name == "samples"} == set()
