"""A sensitivity that was rounded to six digits is the same sensitivity."""

import pytest

from rig.bench.channels import SAME_SENSITIVITY
from rig.drivers.virtual import VirtualDAQ
from tests.rig.rigs import bench_with

EXACT = 0.01 / 9.80665  # 10 mV/g


@pytest.mark.parametrize(("said", "told"), [(0.00101972, False), (EXACT * (1.0 + 3.0 * SAME_SENSITIVITY), True)])
def test_the_virtual_rig_remarks_on_another_sensitivity_but_not_on_rounding(said, told):
    table = bench_with().model_dump()
    channels = [c | ({"sensitivity_v_per_unit": said} if c["name"] == "drive" else {}) for c in table["channels"]]
    rig = VirtualDAQ(bench_with()).rig
    sensors = [s.model_dump() | ({"sensitivity_v_per_unit": EXACT} if s.name == "drive" else {}) for s in rig.sensors]
    remarks = VirtualDAQ(bench_with({"channels": channels}, sensors=sensors)).remarks
    assert any("channel drive: the bench says" in remark for remark in remarks) is told
