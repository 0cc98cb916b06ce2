"""Levels respect the limits at the channel that moves the farthest, which need not be the drive point."""

import pytest

from rig.bench import Bench
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from rig.tuning import TuningRequest, tune
from rig.tuning.levels import reach_m
from tests.refused import refused
from tests.rig.rigs import bench_with

POINTS = {"drive": 0.2, "acc_drive": 0.22, "acc_magnet": 0.55}  # driven near the clamp, the last sensor at the tip
LIMIT_M = 0.003


def far_tip() -> Bench:
    """A cantilever whose tip moves five times as far as the drive point, of which the bench knows no mode shape."""
    channels = [channel | {"mode_shape": None} for channel in bench_with().model_dump()["channels"]]
    specimen = {"drive_mode_shape": None, "linear_frequency_hz": 24.4}
    changes = {"channels": channels, "specimen": specimen, "limits": {"displacement_m": LIMIT_M}}
    return bench_with(changes, structure={"points_m": POINTS})


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    return tune(far_tip(), tmp_path_factory.mktemp("tip") / "test.h5", TuningRequest(level_rms_v=0.02))


def tip_ratio() -> float:
    """As the model has it, the magnets' linear stiffness included."""
    rig = make_daq(far_tip()).rig
    modes = rig.linear_modes
    shape = modes.vectors[:, modes.nearest(24.4)]
    return abs(float(rig.shape("acc_magnet") @ shape) / float(rig.shape("drive") @ shape))


@pytest.mark.slow
def test_the_ratio_of_the_tip_to_the_drive_point_is_measured(tuned):
    assert tuned.response_ratios["acc_magnet"] == pytest.approx(tip_ratio(), rel=0.01)
    assert tuned.plan.plant.response_ratios == pytest.approx(tuned.response_ratios, rel=1e-4)


def test_the_highest_level_keeps_the_tip_within_its_limit(tuned):
    at_the_tip = tuned.response_ratios["acc_magnet"] * max(tuned.levels.levels_m)
    assert at_the_tip == pytest.approx(LIMIT_M / 3.0, rel=1e-3)
    assert "limits.displacement_m = 0.003 at channel 'acc_magnet'" in tuned.levels.why


def test_a_level_asked_for_that_takes_the_tip_beyond_its_limit_is_refused(tuned, tmp_path, monkeypatch):
    monkeypatch.setattr("rig.tuning.tuning.measure", lambda *_: tuned.test)  # the same plant
    with refused(ConfigurationError, field="to_m", value=0.001):
        tune(far_tip(), tmp_path / "test.h5", TuningRequest(level_rms_v=0.02, to_m=0.001))


def test_the_plan_refuses_a_level_that_a_person_raised_beyond_the_limit_of_the_tip(tuned):
    raised = tuned.plan.model_copy(update={"levels_m": (1e-4, 1e-3)})
    with refused(ConfigurationError, field="levels_m[1]", value=0.001):
        raised.check(tuned.bench)
    tuned.plan.check(tuned.bench)


def test_channels_that_move_less_than_the_drive_point_do_not_widen_its_reach(tuned):
    alone = reach_m(tuned.bench, tuned.plant, {"drive": 1.0})
    assert reach_m(tuned.bench, tuned.plant, {"drive": 1.0, "acc_magnet": 0.2}) == alone
    assert alone[0] == LIMIT_M
