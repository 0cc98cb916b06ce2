"""Leaving the valid range of the rig is seen in the telemetry, in the point, in the summary, and changes nothing else."""

import numpy as np
import pytest

import rig
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.measurements import point_rows
from rig.show.summary import summarise_recording
from rig.tick.layout import DEVICE_SHIFT
from tests.rig.rigs import bench_with

FAR = {"limits": {"displacement_m": 0.02, "force_n": 44.0, "acceleration_m_s2": 490.0}}
WAYS = {
    "amplifier_clipped": (None, {"exciter": {"voltage_limit_v": 0.4}}, 1.0),
    "sensor_clipped": (None, {"converter": {"adc_range_v": 0.05}}, 1.0),
    "law_range": (
        FAR,
        {"elements": [{"kind": "magnet-one-sided", "at": "magnet", "strength_n_m4": 1e-15, "gap_m": 0.0005}]},
        1.0,
    ),
}


@pytest.mark.parametrize("flag", WAYS)
def test_a_left_range_is_flagged_row_by_row_and_counted(flag):
    limits, options, level = WAYS[flag]
    plan = SteppedSinePlan(bench="magnet-beam", levels_v=(level,), frequencies_hz=(22.0,), record_periods=5)
    with rig.run(plan, bench=bench_with(limits, **options)) as run:
        part = run.recording.parts[0]
        bit = 1 << (DEVICE_SHIFT + part.information["device_flags"].index(flag))
        flagged = int(np.count_nonzero(part.rows("flags") & bit))
        summary = summarise_recording(run.recording)
        recorded = point_rows(run.recording, 0)
    assert flagged > 0
    assert summary["counters"][flag] == flagged
    count = int(np.count_nonzero(recorded["flags"] & bit))
    assert f"{flag.replace('_', ' ')} in {count} of {recorded.size} samples" in summary["points"][0]["warnings"]
