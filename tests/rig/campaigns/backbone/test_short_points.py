"""Points that nobody waited for: the ramp is evaluated with what follows, by the slow flow."""

import numpy as np
import pytest

import rig
from rig.arming.run_options import Silent
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.measurements import point_rows
from rig.tick.sequencer.layout import SegmentKind
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.rigs import bench_with

PERIODS = {"magnet-beam": 15, "friction-beam": 30}
LOOKED_AT = (2, 6, 11)


def plan_with(plan, **changes):
    return type(plan).model_validate(plan.model_dump(exclude_none=True) | changes)


@pytest.mark.parametrize(("name", "periods"), PERIODS.items())
def test_few_periods_a_point_keep_to_harmonic_balance(name, periods):
    plan = load_plan(f"{name}/backbone-short")
    assert plan.ramp_periods + plan.record_periods == periods
    with rig.run(plan, seed=4) as run:
        assert run.complete
        points = [run.recording.latest[number] for number in LOOKED_AT]
        rows = point_rows(run.recording, LOOKED_AT[0])
    turned = np.unwrap(rows["theta_rad"].astype(float))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi * periods, rel=0.02)  # the ramp is in it
    forces = [factor * point["force_n"] for point in points for factor in (0.97, 1.03)]
    truth = phase_resonance_backbone(VirtualRig.shipped(name), forces_n=forces)
    for point in points:
        frequency, damping = (
            float(np.interp(point["amplitude_m"], truth.amplitude_m, values))
            for values in (truth.modal_frequency_hz, truth.damping_ratio)
        )
        assert point["modal_frequency_hz"] == pytest.approx(frequency, rel=2e-4)
        assert point["damping_ratio"] == pytest.approx(damping, rel=0.02)
        assert 0.0 < point["damping_ratio_std"] < 0.05 * damping
        assert abs(point["phase_error_deg"]) < plan.accepted_phase_error_deg


def test_they_make_a_backbone_and_a_mode():
    plan = plan_with(load_plan("magnet-beam/backbone-short"), levels_m=[2e-4, 2.5e-4, 3.2e-4])
    with rig.run(plan, seed=1) as run:
        backbone = run.backbone()
    assert len(backbone.points) == 3
    assert backbone.directions == ("up", "up", "up")
    np.testing.assert_allclose(backbone.phase_error_deg, 0.0, atol=1e-6)


def test_settled_says_whether_it_had_settled():
    plan = plan_with(load_plan("magnet-beam/backbone-short"), levels_m=[2e-4, 4e-4], record_periods=60)
    with rig.run(plan, seed=1) as run:
        waited = [point["settled"] for point in run.recording.latest.values()]
    with rig.run(plan_with(plan, record_periods=10), seed=1) as run:
        hurried = [point["settled"] for point in run.recording.latest.values()]
    assert waited[0]
    assert not hurried[1]


def test_a_phase_error_or_a_standard_error_too_large_is_not_accepted():
    plan = plan_with(load_plan("magnet-beam/backbone-short"), levels_m=[1e-3, 1.4e-3])
    with rig.run(plan_with(plan, accepted_phase_error_deg=1.0), seed=1) as run:
        reasons = [point["reason"] for point in run.recording.latest.values()]
    assert "phase error" in reasons[1]
    with rig.run(plan_with(plan, accepted_damping_std=1e-6), seed=1) as run:
        reasons = [point["reason"] for point in run.recording.latest.values()]
    assert all("standard error of the damping" in reason for reason in reasons)


def test_a_level_out_of_reach_fails_and_says_why():
    plan = plan_with(load_plan("magnet-beam/backbone-short"), levels_m=[4e-4, 2e-3], plant=None)
    with rig.run(plan, bench=bench_with({"limits": {"voltage_v": 1.5}}), seed=1) as run:
        points = list(run.recording.latest.values())
    assert points[0]["accepted"]
    assert not points[1]["accepted"]
    assert "voltage limit" in points[1]["reason"]


class _Stop(Silent):
    """Asks for the end while the third point is approached."""

    def __init__(self):
        self.points = 0

    def point(self, point, number, total):
        self.points = number

    def advance(self, rows, tick):
        if self.points == 2:
            tick.request_stop()


def test_an_interrupted_point_is_measured_anew(tmp_path):
    path = tmp_path / "stopped.h5"
    plan = plan_with(load_plan("magnet-beam/backbone-short"), levels_m=[2e-4, 2.5e-4, 3.2e-4, 4e-4])
    with rig.run(plan, output=path, seed=1, progress=_Stop()) as run:
        assert not run.complete
        before = run.recording.latest
    with rig.resume(path) as run:
        assert run.complete
        after = run.recording.latest
    assert after[0]["damping_ratio"] == before[0]["damping_ratio"]
    assert sorted(after) == [0, 1, 2, 3]


def test_before_the_first_point_the_lock_is_gained_at_its_level():
    plan = load_plan("magnet-beam/backbone-short")
    kinds = [(s.kind, s.point) for s in plan.segments(5000.0)[:6]]
    assert kinds == [
        (SegmentKind.RAMP, -1),
        (SegmentKind.START, -1),
        (SegmentKind.RAMP, -1),
        (SegmentKind.HOLD, -1),
        (SegmentKind.RAMP, 0),
        (SegmentKind.LEVEL_SWEEP, 0),
    ]


def test_the_slow_flow_needs_the_mode_shape():
    bench = bench_with({"specimen": {"drive_mode_shape": None}})
    with refused(ConfigurationError, "drive-mode-shape"):
        load_plan("magnet-beam/backbone-short").model_copy(update={"plant": None}).check(bench)
