"""Where the output cannot follow its law, no integral runs on: levels are reached without overshoot, up and down."""

import numpy as np
import pytest

from controller import AmplitudeLaw
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment
from tests.closed_loop.laws import carried_out, law_of
from tests.rig.rigs import bench_with

SLOW = bench_with({"limits": {"slew_v_per_s": 0.05}}, noise_scale=0.0)  # a tenth of what the loops would like


def _level(law, level, ramp_periods, periods):
    return [
        Segment(SegmentKind.RAMP, -1, level, ramp_periods, amplitude_law=law),
        Segment(SegmentKind.HOLD, -1, level, periods, amplitude_law=law),
    ]


@pytest.mark.parametrize("force_loop", ["linear", "logarithmic", "through-response"])
@pytest.mark.parametrize(("start_v", "levels"), [(0.3, (0.05, 0.1)), (0.6, (0.1, 0.05))], ids=["up", "down"])
def test_at_the_slew_limit_a_force_is_reached_without_overshoot(force_loop, start_v, levels):
    law = law_of("magnet-beam", force_loop=force_loop, k4=10.0)
    segments = [
        *_level(AmplitudeLaw.VOLTAGE, start_v, 10.0, 100.0),
        *_level(AmplitudeLaw.FORCE, levels[0], 10.0, 200.0),
        *_level(AmplitudeLaw.FORCE, levels[1], 5.0, 400.0),
    ]
    rows, _ = carried_out(SLOW, law, segments)
    voltage = np.abs(rows["command_v"][rows["segment"] == 5])
    steps = np.abs(np.diff(np.abs(rows["command_v"][rows["segment"] == 4])))
    assert steps.max() == pytest.approx(0.05 / 5000, rel=0.02)  # it was the slew limit that set the pace
    end = voltage[-1000:].mean()
    assert voltage.min() > 0.98 * min(end, voltage[0])
    assert voltage.max() < 1.02 * max(end, voltage[0])
    last = rows[rows["segment"] == 5][-2052:]  # ten periods
    force = abs(2 * np.mean(last["inputs"][:, 0] * np.exp(-1j * last["theta_rad"].astype(float))))
    assert force == pytest.approx(levels[1], rel=0.02)


@pytest.mark.parametrize("level_m", [1.5e-3, 3e-4])
def test_at_the_slew_limit_a_response_is_reached_without_overshoot(level_m):
    segments = [
        *_level(AmplitudeLaw.VOLTAGE, 0.6, 10.0, 100.0),
        *_level(AmplitudeLaw.RESPONSE, 7e-4, 10.0, 200.0),
        *_level(AmplitudeLaw.RESPONSE, level_m, 5.0, 600.0),
    ]
    rows, _ = carried_out(SLOW, law_of("magnet-beam"), segments)
    voltage = np.abs(rows["command_v"][rows["segment"] == 5])
    end = voltage[-1000:].mean()
    assert voltage.min() > 0.98 * min(end, voltage[0])
    assert voltage.max() < 1.02 * max(end, voltage[0])
