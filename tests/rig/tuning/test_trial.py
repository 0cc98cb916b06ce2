"""A trial of a tuned plan: which levels count as held, and what the plan makes of them."""

import dataclasses
import json
import shutil
from itertools import pairwise

import numpy as np
import pytest

from rig.arming.run_options import RunOptions
from rig.campaigns.backbone.ramps import Ramp
from rig.campaigns.evaluation.point import Point, Purity, Quality, Spectrum, Vibration
from rig.campaigns.plans import load_plan
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason
from rig.tuning import TuningError, TuningRequest, try_plan, tune
from rig.tuning.levels import LevelChoice
from rig.tuning.trial import IN_ORDER, PlanTrial, TrialEndedError
from tests.refused import refused
from tests.rig.tuning.tuned import tuned_once

PLANNED = LevelChoice(
    levels_m=(1e-4, 2e-4, 4e-4, 8e-4), needed_v=(0.1, 0.2, 0.4, 0.8), forces_n=(0.01, 0.02, 0.04, 0.08), why="chosen"
)


def point(number, quality=Quality.GOOD, *, settled_after=80.0, nonharmonic=0.01, reason=""):
    return Point(
        number=number,
        level=PLANNED.levels_m[number],
        level_unit="m",
        direction="up",
        repeat=1,
        settled=quality.accepted,
        reason=reason,
        quality=quality,
        settle_periods=settled_after,
        nonharmonic_force=nonharmonic,
    )


def trial(tmp_path, *points, tripped=False):
    return PlanTrial(
        recording=tmp_path / "tuned-trial.h5",
        points=points,
        end="force above its limit" if tripped else "the plan was carried out",
        tripped=tripped,
        judged_channels=(0, 1),
        accepted_drift=0.05,
        longest_settling=1000.0,
        accepted_nonharmonic=0.1,
    )


def test_a_plan_whose_levels_were_all_held_stays_as_it_is(tmp_path):
    found = trial(tmp_path, *map(point, range(4)))
    assert (list(found.held), found.missing) == ([0, 1, 2, 3], "")
    assert found.levels(PLANNED) is PLANNED


@pytest.mark.parametrize("quality", [Quality.TOO_STEEP, Quality.NEAR_LIMIT, Quality.LOST_LOCK, Quality.REJECTED])
def test_levels_lie_within_the_longest_row_that_was_held(tmp_path, quality):
    found = trial(tmp_path, point(0, Quality.REJECTED), point(1), point(2), point(3, quality, reason="because"))
    assert found.missing == "level 1: rejected"
    levels = found.levels(PLANNED)
    assert levels.levels_m == pytest.approx(np.geomspace(2e-4, 4e-4, 4), rel=1e-3)
    assert levels.needed_v == pytest.approx(np.geomspace(0.2, 0.4, 4), rel=1e-3)
    assert levels.forces_n == pytest.approx(np.geomspace(0.02, 0.04, 4), rel=1e-3)
    assert "tuned-trial.h5" in levels.why


def test_a_level_that_settled_late_is_not_held(tmp_path):
    found = trial(tmp_path, point(0), point(1), point(2), point(3, settled_after=700.0))
    assert list(found.held) == [0, 1, 2]
    assert found.missing == "level 4: took 700 periods to settle"
    assert found.is_disturbed


@pytest.mark.parametrize(
    ("force", "drive", "response", "held"), [(0.04, 0, 0, 3), (0.02, 0.035, 0, 3), (0, 0, 0.04, 4)]
)
def test_a_level_whose_force_or_drive_drifted_is_not_held(tmp_path, force, drive, response, held):
    drift = np.array([force, drive, response], complex)
    nothing = np.zeros((3, 2), complex)
    spectrum = Spectrum(harmonics=nothing, harmonics_std=None, residual_rms=np.zeros(3), drift=drift)
    purity = Purity(force_purity=1.0, response_purity=1.0, power_indicator=1.0, harmonic_power=0.0)
    vibration = Vibration(
        frequency_hz=24.0, force_n=0.1, amplitude_m=8e-4, voltage_v=0.8, purity=purity, periods=50, spectrum=spectrum
    )
    last = dataclasses.replace(point(3), vibration=vibration)
    found = trial(tmp_path, *map(point, range(3)), last)
    assert len(found.held) == held
    assert bool(found.missing) == (held < 4)


@pytest.mark.parametrize(("nonharmonic", "held"), [(0.049, 4), (0.051, 3)])
def test_a_level_whose_force_rounding_nearly_spoils_is_not_held(tmp_path, nonharmonic, held):
    found = trial(tmp_path, point(0, nonharmonic=nonharmonic), *map(point, range(1, 4)))
    assert len(found.held) == held
    assert found.missing == ("" if held == 4 else "level 1: 5.1 % of the force's RMS was not harmonic")


def test_a_trip_is_the_reason_for_what_is_missing(tmp_path):
    found = trial(tmp_path, point(0), point(1), point(2, Quality.INTERRUPTED), tripped=True)
    assert found.missing == "force above its limit"
    assert not found.is_disturbed
    assert found.levels(PLANNED).levels_m[-1] == 2e-4


def test_no_range_that_was_held_is_refused_with_the_reason(tmp_path):
    found = trial(tmp_path, point(0), point(1, Quality.NOT_SETTLED, reason="not settled within 1000 periods"))
    with refused(TuningError, "trial-of-plan-held"):
        found.levels(PLANNED)
    one = dataclasses.replace(PLANNED, levels_m=(1e-4,), needed_v=(0.1,), forces_n=(0.01,))
    assert trial(tmp_path, point(0)).levels(one) is one


@pytest.mark.parametrize(
    ("qualities", "highest_m"),
    [
        ([Quality.GOOD, Quality.LOST_LOCK], 1e-4),
        ([Quality.TOO_STEEP], 1e-4),
        ([Quality.NEAR_LIMIT], 1e-4),
        ([Quality.GOOD, Quality.GOOD, Quality.LOST_LOCK], None),  # a range was held
        ([Quality.GOOD, Quality.NOT_SETTLED], None),  # by rounding, of which there is more below
        ([Quality.REJECTED, Quality.GOOD, Quality.LOST_LOCK], None),
    ],
)
def test_levels_are_lowered_where_the_lowest_were_too_large(tmp_path, qualities, highest_m):
    qualities = [*qualities, *[Quality.LOST_LOCK] * (4 - len(qualities))]
    found = trial(tmp_path, *map(point, range(4), qualities))
    lower = found.lower_levels(PLANNED)
    if highest_m is None:
        assert lower is None
    else:
        assert lower.levels_m == pytest.approx(np.geomspace(highest_m / 2.0, highest_m, 4), rel=1e-3)
        assert "too large in a trial" in lower.why
    assert trial(tmp_path, point(0), tripped=True).lower_levels(PLANNED) is None


def test_steps_become_finer_where_a_joint_slips_from_one_level_to_the_next(tmp_path, monkeypatch):
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan.levels_m)
        few = len(plan.levels_m) == len(PLANNED.levels_m)
        qualities = [
            Quality.IMPLAUSIBLE if few and number > 1 else Quality.GOOD for number in range(len(plan.levels_m))
        ]
        points = [dataclasses.replace(point(0, quality), number=number) for number, quality in enumerate(qualities)]
        return dataclasses.replace(trial(tmp_path, *points), recording=recording)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    found = try_plan(tuning, tmp_path / "t.h5")
    assert played == [PLANNED.levels_m, pytest.approx(np.geomspace(1e-4, 8e-4, 7), rel=1e-3)]
    assert found.levels.levels_m == played[-1]
    assert "steps half as large" in found.levels.why


@pytest.mark.parametrize("failed", [False, True])
def test_finer_steps_are_for_a_joint_and_not_for_a_sensor_that_has_failed(tmp_path, monkeypatch, failed):
    """The force seems five times as large from the second level of the first trial on, for a joint at a low level no more."""
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    purity = Purity(force_purity=1.0, response_purity=1.0, power_indicator=1.0, harmonic_power=0.0)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan.levels_m)
        count, few = len(plan.levels_m), len(played) == 1
        force_n = 0.05 if failed and not few else 0.01
        seen = Vibration(
            frequency_hz=24.0,
            force_n=force_n,
            amplitude_m=1e-4,
            voltage_v=0.1,
            purity=purity,
            periods=50,
            spectrum=None,
        )
        qualities = [Quality.IMPLAUSIBLE if few and number > 1 else Quality.GOOD for number in range(count)]
        points = [dataclasses.replace(point(0, quality), number=number) for number, quality in enumerate(qualities)]
        points[0] = dataclasses.replace(points[0], vibration=seen)
        return dataclasses.replace(trial(tmp_path, *points), recording=recording)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    if not failed:
        assert len(try_plan(tuning, tmp_path / "t.h5").levels.levels_m) == 7
        return
    with pytest.raises(
        TuningError, match=r"the lowest level took 0\.01 N in one trial and 0\.05 N in the next; .* level 3"
    ):
        try_plan(tuning, tmp_path / "t.h5")


def test_a_trial_without_points_repeats_nothing(tmp_path):
    trial(tmp_path).check_repeats(trial(tmp_path, point(0)))


def test_a_level_that_is_implausible_from_the_beginning_is_no_reason_for_finer_steps(tmp_path):
    assert trial(tmp_path, point(0, Quality.IMPLAUSIBLE), point(1)).finer_levels(PLANNED) is None
    assert trial(tmp_path, *map(point, range(4))).finer_levels(PLANNED) is None


def test_a_trial_that_ends_for_another_reason_says_what_bounds_the_levels(tmp_path, monkeypatch):
    tuning = dataclasses.replace(tuned_once("magnet-beam"), level_notes=("five bits of force",))

    def carried_out(plan, bench, recording, options):
        raise TrialEndedError("sensor dead")

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    with pytest.raises(TrialEndedError, match=r"^sensor dead; five bits of force$"):
        try_plan(tuning, tmp_path / "t.h5")


def test_a_plan_whose_lowest_levels_were_too_large_is_tried_with_lower_ones(tmp_path, monkeypatch):
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan.levels_m)
        qualities = [Quality.GOOD if level <= 1.1e-4 else Quality.LOST_LOCK for level in plan.levels_m]
        return dataclasses.replace(trial(tmp_path, *map(point, range(4), qualities)), recording=recording)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    found = try_plan(tuning, tmp_path / "t.h5")
    assert len(played) == 2
    assert played[-1] == found.levels.levels_m == pytest.approx(np.geomspace(0.5e-4, 1e-4, 4), rel=1e-3)


@pytest.mark.parametrize("better", [True, False])
def test_larger_levels_are_tried_where_rounding_disturbs_and_kept_if_they_are_better(tmp_path, monkeypatch, better):
    few = PLANNED.within(1e-4, 1.5e-4, "rounding")
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=few, larger=PLANNED)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan.levels_m)
        recording.write_text(f"trial {len(played)}")
        held = 4 if len(played) > 2 else 3 if len(played) == 1 else 4 if better else 1
        qualities = [Quality.GOOD] * held + [Quality.REJECTED] * (4 - held)
        return dataclasses.replace(trial(tmp_path, *map(point, range(4), qualities)), recording=recording)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    found = try_plan(tuning, tmp_path / "tuned-trial.h5")
    assert played[:2] == [few.levels_m, PLANNED.levels_m]
    first = found.trials[0]
    assert first.recording == tmp_path / "tuned-trial.h5"
    if better:
        assert found.levels is PLANNED
        assert first.recording.read_text() == "trial 2"
        assert "these are larger" in found.notes[-1]
        assert len(found.trials) == 1
    else:
        assert found.levels.levels_m[-1] == few.levels_m[2]
        assert first.recording.read_text() == "trial 1"
        assert found.trial.recording.read_text() == "trial 3"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(one.recording.name for one in found.trials)


def test_a_plan_that_a_trial_has_changed_is_tried_again_until_its_levels_are_held(tmp_path, monkeypatch):
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append((plan.levels_m, recording.name, options.seed))
        above = Quality.GOOD if plan.levels_m[-1] < last_held else Quality.TOO_STEEP
        return dataclasses.replace(trial(tmp_path, *map(point, range(3)), point(3, above)), recording=recording)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    last_held = 3.5e-4
    found = try_plan(tuning, tmp_path / "t.h5", RunOptions(seed=7))
    assert [name for _, name, _ in played] == ["t.h5", "t-2.h5", "t-3.h5"]
    assert [seed for *_, seed in played] == [7, 8, 9]
    assert [levels[-1] for levels, *_ in played] == pytest.approx([8e-4, 4e-4, 2.52e-4], rel=1e-3)
    assert found.levels.levels_m == played[-1][0]
    assert [bool(one.missing) for one in found.trials] == [True, True, False]
    played.clear()
    last_held = 0.0  # never: the third trial is the last
    found = try_plan(tuning, tmp_path / "t.h5")
    assert len(played) == len(found.trials) == 3
    assert found.levels.levels_m[-1] < played[-1][0][-1]


def test_levels_that_were_all_accepted_are_better_than_some_that_were_never_tried(tmp_path, monkeypatch):
    """A first level that drifted a little is left out; the one above is lost at the start, for a stop lies between them."""
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan.levels_m)
        first = point(0, Quality.LOST_LOCK) if len(played) == 3 else point(0, settled_after=700.0)
        ramps = (Ramp(4e-4, 8e-4, 1.0, 1.0, 12.0 * len(played), 0.0),)
        return dataclasses.replace(trial(tmp_path, first, *map(point, range(1, 4))), recording=recording, ramps=ramps)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    found = try_plan(tuning, tmp_path / "t.h5")
    assert [levels[0] for levels in played] == pytest.approx([1e-4, 2e-4, 3.17e-4], rel=1e-2)
    assert found.levels is PLANNED
    assert found.ramp_factors == (1.0, 1.0, 1.0, 3.0)  # of their trial
    assert len(found.trials) == 3


def test_a_second_trial_has_the_longer_ramps_of_the_first(tmp_path, monkeypatch):
    tuning = dataclasses.replace(tuned_once("magnet-beam"), levels=PLANNED, larger=None)
    played = []

    def carried_out(plan, bench, recording, options):
        played.append(plan)
        qualities = [Quality.GOOD] * 3 + [Quality.TOO_STEEP if len(played) == 1 else Quality.GOOD]
        factor = (plan.ramp_factors or (1.0,))[-1]
        ramps = tuple(Ramp(*levels, factor, factor, 12.0 / factor, 0.0) for levels in pairwise(plan.levels_m[-3:]))
        return dataclasses.replace(trial(tmp_path, *map(point, range(4), qualities)), recording=recording, ramps=ramps)

    monkeypatch.setattr("rig.tuning.trials.carried_out", carried_out)
    found = try_plan(tuning, tmp_path / "t.h5")
    assert played[0].ramp_factors == ()
    assert played[1].ramp_factors == found.plan.ramp_factors == (1.0, 1.0, 2.0, 2.0)
    assert "ramp_factors = [1.0, 1.0, 2.0, 2.0]" in found.plan_toml


@pytest.mark.slow
def test_a_trial_ends_in_order_near_a_limit_and_the_plan_ends_below(tmp_path):
    request = TuningRequest(level_rms_v=0.02, to_m=0.0037, points=4)  # 98 % of the limit at the channel of the magnet
    tuning = tune("magnet-beam", tmp_path / "tuned.h5", request)
    found = try_plan(tuning, tmp_path / "tuned-trial.h5", RunOptions(seed=3))
    first, second = found.trials
    assert [point.quality.accepted for point in first.points] == [True, True, True, False]
    assert first.points[3].quality is Quality.NEAR_LIMIT
    assert not first.tripped
    assert (second.missing, len(second.points)) == ("", 4)
    assert found.levels.levels_m[-1] == tuning.levels.levels_m[2]
    assert found.plan.levels_m == pytest.approx(found.levels.levels_m)
    assert found.plan.near_limits == 0.9
    with Recording(tmp_path / "tuned-trial.h5") as recording:
        assert recording.parts[-1].information["about"]["purpose"] == "trial of a tuned plan"


@pytest.mark.slow
def test_the_command_says_what_the_trial_held_and_its_file_is_not_overwritten(command, tmp_path):
    line = "tune --bench magnet-beam -o tuned.toml --level 0.02 --law phase --points 2 --rehearse 0 --json"
    told = json.loads(command(line).succeeded().out)
    assert told["trials"][-1] == {
        "recording": "tuned-trial.h5",
        "accepted": 2,
        "points": 2,
        "held": [0, 1],
        "missing": "",
        "end": "the plan was carried out",
        "tripped": False,
    }
    for name in ("tuned.toml", "tuned.h5"):
        (tmp_path / name).unlink()
    again = command(line)
    assert again.status == 1
    assert "tuned-trial.h5: exists already" in again.err
    assert not (tmp_path / "tuned.h5").exists()  # nothing was driven


@pytest.mark.slow
def test_without_a_trial_only_the_multisine_is_driven(command, tmp_path):
    line = "tune --bench magnet-beam -o tuned.toml --level 0.02 --law phase --points 2 --rehearse 0 --no-trial --json"
    assert json.loads(command(line).succeeded().out)["trials"] == []
    assert {path.name for path in tmp_path.iterdir()} == {"tuned.toml", "tuned.h5"}


def test_a_run_that_was_stopped_is_no_trial(tmp_path, monkeypatch):
    tuning = tuned_once("magnet-beam")
    copied = shutil.copy(tuning.recording, tmp_path / "stopped.h5")  # a run with another end than a level out of reach
    recording = Recording(copied)
    monkeypatch.setattr(recording.parts[-1], "end", {"reason": "stop_requested", "text": "stopped by request"})
    monkeypatch.setattr("rig.tuning.trial.run_plan", lambda *_: recording)
    with refused(TrialEndedError, "trial-of-plan-stopped"):
        try_plan(tuning, tmp_path / "tuned-trial.h5")


@pytest.mark.slow
def test_a_plan_whose_trial_was_stopped_is_written_untried(command, tmp_path, monkeypatch):
    def stopped(*_):
        raise TrialEndedError("trial of the plan: stopped by request")

    monkeypatch.setattr("rig.tuning.trials.carried_out", stopped)
    told = command("tune --bench magnet-beam -o tuned.toml --level 0.02 --law phase --points 2 --rehearse 0")
    assert told.status == 1
    assert "the plan was written to tuned.toml; its trial is not complete" in told.err
    assert load_plan("tuned.toml").levels_v is not None


@pytest.mark.slow
def test_a_plan_that_held_nothing_is_not_written(command, tmp_path, monkeypatch):
    monkeypatch.setattr("rig.tuning.trials.carried_out", lambda *_: trial(tmp_path, point(0, Quality.NOT_SETTLED)))
    told = command("tune --bench magnet-beam -o tuned.toml --level 0.02 --law phase --points 2 --rehearse 0")
    assert told.status == 1
    assert "held 0 of 2 levels" in told.err
    assert not (tmp_path / "tuned.toml").exists()


def test_the_recording_of_the_multisine_is_none_of_the_other_results(command, tmp_path):
    told = command("tune --bench magnet-beam -o tuned.toml --recording tuned-trial.h5")
    assert told.status == 1
    assert "--recording tuned-trial.h5: tuned-trial.h5 is another result of this command" in told.err
    assert not list(tmp_path.iterdir())


def test_the_ends_that_tell_of_a_plan_are_ends_of_runs():
    assert set(IN_ORDER) <= {reason.name.lower() for reason in EndReason}
