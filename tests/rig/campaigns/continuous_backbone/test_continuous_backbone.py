"""The continuous backbone: up and down without waiting, as accurate as harmonic balance of the coupled rig says it is."""

import shutil

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.interpolate import PchipInterpolator

import rig
from identification import IdentificationError, ModalProperties
from rig.arming.run_options import Silent
from rig.campaigns.continuous_backbone.ways import turning_point
from rig.campaigns.evaluation.measured_together import Passage
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.figures.files import plot
from rig.measurements import continuous_backbones
from rig.results.identify import identify_model
from rig.results.nonlinear_mode.options import NonlinearModeOptions
from rig.show.summary import summarise
from rig.tick.sequencer.layout import Outcome, SegmentKind
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.rigs import bench_with

PLAN = load_plan("magnet-beam/continuous-backbone")
UNKNOWN = {"plant": None}  # a known plant refuses levels that the test's limits do not allow
FORCES = (0.0412, 0.120, 0.26, 0.412)


def plan_with(plan=PLAN, **changes):
    return type(plan).model_validate(plan.model_dump(exclude_none=True) | changes)


@pytest.fixture(scope="module")
def truth():
    found = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), forces_n=FORCES)
    return found.amplitude_m, found.modal_frequency_hz, found.damping_ratio


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, truth):
    path = tmp_path_factory.mktemp("continuous") / "out.h5"
    plan = plan_with(levels_m=[1.144e-4, *truth[0].tolist(), 2.036e-3])
    rig.run(plan, output=path, seed=3).close()
    return path


def periods_until_0_v(part):
    """Periods from the first driven sample to the last."""
    driven = np.flatnonzero(part.rows("output_v"))
    theta = part.rows("theta_rad")[driven[0] : driven[-1] + 1].astype(float)
    return np.sum(np.mod(np.diff(theta), 2 * np.pi)) / (2 * np.pi)


def test_it_takes_100_periods_to_0_v_and_keeps_to_harmonic_balance(recorded, truth):
    summary = summarise(recorded)
    points = summary["points"][1:-1]
    assert all(point["accepted"] for point in summary["points"])
    with rig.Recording(recorded) as recording:
        assert periods_until_0_v(recording.parts[0]) <= 100.5
    np.testing.assert_allclose([point["modal_frequency_hz"] for point in points], truth[1], rtol=1e-4)
    np.testing.assert_allclose([point["damping_ratio"] for point in points], truth[2], rtol=0.02)
    np.testing.assert_allclose([point["amplitude_m"] for point in points], truth[0], rtol=1e-9)


def test_the_friction_beam_keeps_to_harmonic_balance_in_700_periods_to_0_v():
    plan = load_plan("friction-beam/continuous-backbone")
    found = phase_resonance_backbone(VirtualRig.shipped("friction-beam"), forces_n=(0.46, 2.15, 6.8))
    levels = [1.078e-5, *found.amplitude_m.tolist(), 2.424e-4]
    with rig.run(plan_with(plan, levels_m=levels), seed=1) as run:
        assert periods_until_0_v(run.recording.parts[0]) <= 702.0
        points = list(run.recording.latest.values())[1:-1]
        (ways,) = continuous_backbones(run.recording)
    np.testing.assert_allclose([p["modal_frequency_hz"] for p in points], found.modal_frequency_hz, rtol=1e-4)
    np.testing.assert_allclose([p["damping_ratio"] for p in points], found.damping_ratio, rtol=0.02)
    # The joint's memory: on the way up less is dissipated than on the way down, and the mean of both lies between.
    assert ways.damping_ratio[0, 3] < found.damping_ratio[2] < ways.damping_ratio[1, 3]


def test_standard_errors_are_stated_and_hold_the_truth(recorded, truth):
    for point, frequency, damping in zip(summarise(recorded)["points"][1:-1], truth[1], truth[2], strict=True):
        assert 0.0 < point["damping_ratio_std"] < 0.02 * damping
        assert abs(point["damping_ratio"] - damping) < 5.0 * point["damping_ratio_std"]
        assert abs(point["modal_frequency_hz"] - frequency) < 8.0 * point["modal_frequency_std_hz"]


def test_it_gives_a_nonlinear_mode_and_a_figure(recorded, tmp_path, truth):
    mode = identify_model([recorded], NonlinearModeOptions())
    assert mode.source == "continuous backbone"
    assert np.all(mode.damping_ratio_std > 0.0)
    properties = ModalProperties.of(mode)
    at = truth[0] / 0.908466
    np.testing.assert_allclose([properties.frequency_rad_s(a) / 2 / np.pi for a in at], truth[1], rtol=5e-4)
    plot(recorded, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000


def test_repeats_are_backbones_of_their_own_and_make_one_mode(tmp_path):
    path = tmp_path / "twice.h5"
    with rig.run(plan_with(repeats=2, levels_m=[2e-4, 4e-4, 8e-4], sweep_periods=30), output=path, seed=2) as run:
        assert run.complete
        assert [one.amplitude_m.size for one in continuous_backbones(run.recording)] == [3, 3]
        assert run.backbone().repeats == (1, 1, 1, 2, 2, 2)
    assert identify_model([path], NonlinearModeOptions()).modal_frequency_hz.size == 3


def test_at_the_voltage_limit_the_level_turns_and_what_was_reached_is_kept():
    bench = bench_with({"limits": {"voltage_v": 1.5}})
    with rig.run(plan_with(**UNKNOWN, levels_m=[2e-4, 4e-4, 6e-4, 2e-3]), bench=bench, seed=0) as run:
        points = list(run.recording.latest.values())
        assert not run.complete
    assert [point["accepted"] for point in points] == [True, True, True, False]
    assert "voltage limit" in points[-1]["reason"]
    assert "damping_ratio" not in points[-1]


def test_a_trip_on_the_way_up_keeps_what_was_found_there_and_says_so():
    channels = [channel | {"mode_shape": None} for channel in bench_with().model_dump()["channels"]]
    bench = bench_with({"channels": channels, "limits": {"acceleration_m_s2": 60.0}})  # the drive point stays below
    with rig.run(plan_with(**UNKNOWN, levels_m=[2e-4, 4e-4, 2e-3]), bench=bench, seed=0) as run:
        points = list(run.recording.latest.values())
        with refused(IdentificationError, "none-of-the-recording-was-accepted", field="points"):
            run.backbone()
    assert [point["accepted"] for point in points] == [False] * 3
    assert points[0]["direction"] == "up"
    assert points[0]["modal_frequency_hz"] == pytest.approx(24.38, rel=1e-3)
    assert "way up only" in points[0]["reason"]
    assert "acc_magnet" in points[0]["reason"]
    assert "frequency_hz" not in points[-1]


class _Stop(Silent):
    def advance(self, rows, tick):
        if tick.sample > 2.6 * 5000.0:
            tick.request_stop()


def test_an_interrupted_way_down_is_resumed_over_the_levels_that_it_lacks(tmp_path):
    path = tmp_path / "stopped.h5"
    with rig.run(PLAN, output=path, seed=0, progress=_Stop()) as run:
        before = run.recording.latest
    kept = [number for number, point in before.items() if point["accepted"]]
    lacking = [number for number, point in before.items() if not point["accepted"]]
    assert kept == list(range(lacking[-1] + 1, 13))
    assert "stopped by request" in before[0]["reason"]
    with rig.resume(path) as run:
        assert run.complete
        after = run.recording.latest
        assert all(after[number]["damping_ratio"] == before[number]["damping_ratio"] for number in kept)
        assert [point["number"] for point in run.recording.parts[1].points] == lacking
        highest = run.recording.parts[1].rows("command_v")
    assert np.abs(highest).max() < 1.0


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Four levels about a gap."""
    path = tmp_path_factory.mktemp("measured") / "out.h5"
    rig.run(plan_with(levels_m=[2e-4, 4e-4, 1.2e-3]), output=path, seed=0).close()
    return path


@pytest.fixture(scope="module")
def finer():
    found = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), forces_n=np.geomspace(0.03, 0.7, 16))
    return PchipInterpolator(found.amplitude_m, found.modal_frequency_hz)


@pytest.mark.parametrize(
    "added", [[2.2e-3], [7e-4], [1.4e-4], [1.4e-4, 2.2e-3]], ids=["highest", "middle", "lowest", "both ends"]
)
def test_a_level_that_is_added_is_accepted_wherever_it_lies(measured, tmp_path, finer, added):
    path = shutil.copy(measured, tmp_path / "out.h5")
    with rig.resume(path, plan=plan_with(levels_m=sorted([2e-4, 4e-4, 1.2e-3, *added])), seed=4) as run:
        assert run.complete
        points = run.recording.parts[1].points
    assert [point["level"] for point in points] == added
    assert [(point["direction"], point["reason"]) for point in points] == [("both", "")] * len(added)
    np.testing.assert_allclose([point["modal_frequency_hz"] for point in points], finer(added), rtol=5e-4)


def test_after_the_voltage_limit_a_lower_level_in_its_place_is_accepted(tmp_path):
    path, bench = tmp_path / "out.h5", bench_with({"limits": {"voltage_v": 1.5}})
    rig.run(plan_with(**UNKNOWN, levels_m=[2e-4, 4e-4, 2e-3]), bench=bench, output=path, seed=0).close()
    with rig.resume(path, plan=plan_with(**UNKNOWN, levels_m=[2e-4, 4e-4, 6e-4]), seed=1) as run:
        assert run.complete
        (point,) = run.recording.parts[1].points
    assert (point["level"], point["direction"], point["reason"]) == (6e-4, "both", "")


@pytest.mark.parametrize("lowest", [1e-4, 1e-3])
def test_a_way_down_without_a_way_up_is_a_way_down(lowest):
    found = turning_point(
        [
            Passage(SegmentKind.RAMP, lowest, 0, 100, Outcome.NOT_SETTLED),
            Passage(SegmentKind.LEVEL_SWEEP, lowest, 100, 900, Outcome.DONE),
        ]
    )
    assert found == 100


def test_a_frequency_beyond_its_window_ends_what_is_taken():
    controller = PLAN.controller.model_copy(update={"frequency_window_hz": (21.933, 24.55)})
    changed = plan_with(levels_m=[2e-4, 4e-4, 2e-3], controller=controller.model_dump(exclude_none=True))
    with rig.run(changed, seed=0) as run:
        points = list(run.recording.latest.values())
    assert points[0]["accepted"]
    assert not points[-1]["accepted"]
    assert "end of its window" in points[-1]["reason"]


def test_a_round_goes_over_the_levels_that_are_left():
    plan = plan_with(levels_m=[1e-4, 2e-4, 4e-4], repeats=2, margin=0.1)
    left = [s for s in plan.segments(5000.0, frozenset({0, 2, 3, 4, 5})) if s.kind is SegmentKind.LEVEL_SWEEP]
    assert [s.level for s in left] == pytest.approx([2.2e-4, 2e-4 / 1.1])
    assert plan.segments(5000.0, frozenset(range(6))) == ()
    assert plan.together(4) == {3, 4, 5}


def test_levels_are_metres():
    with refused(ValidationError, field="levels_v", allowed="levels_m"):
        plan_with(levels_m=None, levels_v=[0.1, 0.2])


def test_a_level_whose_margin_leads_beyond_the_limit_is_refused():
    with refused(ConfigurationError, "allows-up-to", field="margin", value=0.1):
        plan_with(levels_m=[1e-4, 3.7e-3]).check(bench_with())


def test_the_shape_of_the_plant_is_used_with_its_error_and_not_that_of_the_bench(tmp_path, truth):
    shape = PLAN.plant.drive_shape
    plant = PLAN.plant.model_copy(update={"drive_shape_std": 0.02 * shape})
    plan = plan_with(
        levels_m=[1.144e-4, *truth[0].tolist(), 2.036e-3], plant=plant.model_dump(), accepted_damping_std=0.03
    )
    bench = bench_with({"specimen": {"drive_mode_shape": 1.3 * shape}})
    with rig.run(plan, bench=bench, output=tmp_path / "out.h5", seed=3) as run:
        points = summarise(tmp_path / "out.h5")["points"][1:-1]
        (mode,) = (one.nonlinear_mode() for one in continuous_backbones(run.recording))
    assert all(point["accepted"] for point in points)  # 4 % by the shape is no reason to measure again
    found = np.array([[point[name] for name in ("damping_ratio", "damping_ratio_std")] for point in points])
    np.testing.assert_allclose(found[:, 0], truth[2], rtol=0.03)
    assert np.all(found[:, 1] > 0.04 * found[:, 0])
    np.testing.assert_allclose(found[:, 1], 0.04 * found[:, 0], rtol=0.2)
    np.testing.assert_allclose(mode.damping_ratio[1:-1], truth[2], rtol=0.03)
    assert np.all(mode.systematic("damping_ratio") > 0.035 * mode.damping_ratio)
