"""Points refused for something that passes are measured again; what does not pass is not tried again."""

import json
import re
from contextlib import ExitStack, contextmanager
from functools import partial

import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.arming.run_options import RunOptions, Silent
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.evaluation.recorded import point_rows, points_of
from rig.campaigns.plans import load_plan
from rig.campaigns.running.runner import resume_run, run_plan
from rig.emulator.emulated import emulated
from rig.loop.loop import Loop
from rig.loop.session import open_session
from rig.show.summary import summarise_recording
from rig.show.tables import print_summary
from rig.tick.layout import DEVICE_SHIFT
from rig.tick.sequencer.segments import SettleRule
from tests.closed_loop.laws import knock, plan_of
from tests.reference.harmonic_balance import backbone, backbone_at_voltages
from tests.reference.parameters import ONE_SIDED
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.rigs import bench_with

LATE = {"held_per_s": 0.3, "held_s": 0.014}
ALWAYS = {"held_per_s": 0.5, "held_s": 0.014}  # eight in a record of 400 periods, on average
NO_TOLERANCE = {"accepted_phase_error_deg": 1e-6}


def late_bench(faults, **changes):
    return bench_with({"block": 14, **changes}, faults=faults, queue_blocks=2)


def backbone_with(**changes):
    return load_plan("magnet-beam/backbone").model_copy(update=changes)


@pytest.fixture(scope="module")
def measured():
    with rig.run("magnet-beam/backbone", bench=late_bench(LATE)) as run:
        yield run


def test_without_repetition_about_a_third_of_the_points_is_refused():
    with rig.run(backbone_with(retries=0), bench=late_bench(LATE)) as run:
        points = points_of(run.recording)
    refused = [point for point in points if not point.accepted]
    assert 3 <= len(refused) <= 7
    assert {point.quality for point in refused} <= {Quality.REJECTED, Quality.DISTURBED}
    assert all(point.attempts == 1 for point in points)
    assert not run.complete


def test_with_repetition_all_points_are_accepted_and_are_those_of_harmonic_balance(measured):
    assert measured.complete
    points = points_of(measured.recording)
    assert len(points) == 13
    assert len(measured.recording.parts) == 1  # at once
    assert 3 <= sum(len(point.refused_before) for point in points) <= 12
    mode = nonlinear_mode(measured.backbone())
    truth = backbone_at_voltages(ONE_SIDED, [point.level for point in points])
    np.testing.assert_allclose(mode.frequency_hz, [t.frequency_hz for t in truth], rtol=1e-4)
    np.testing.assert_allclose(mode.force_n, [t.force_amplitude_n for t in truth], rtol=2.5e-3)
    np.testing.assert_allclose(mode.damping_ratio, [t.damping_ratio for t in truth], rtol=2.5e-3)


def test_what_is_kept_of_a_refused_attempt_stands_with_its_point_and_its_rows_are_recorded(measured):
    held = 1 << (DEVICE_SHIFT + 5)
    part = measured.recording.parts[0]
    for point in points_of(measured.recording):
        assert not np.any(point_rows(measured.recording, point.number)["flags"] & held)
        for attempt in point.refused_before:
            assert attempt.quality is Quality.REJECTED
            assert attempt.reason.startswith("outputs came too late: held in ")
            assert attempt.rows.end_sample <= point.rows.first_sample
            rows = part.read(attempt.rows.first_sample, attempt.rows.end_sample)
            counted = np.count_nonzero(rows["flags"] & held)
            assert f"held in {counted} samples" in attempt.reason
            assert attempt.frequency_hz == pytest.approx(point.vibration.frequency_hz, rel=5e-3)
            assert attempt.force_n == pytest.approx(point.vibration.force_n, rel=0.05)


def test_fused_and_exchanged_runs_repeat_the_same_points_bit_for_bit(monkeypatch):
    plan = backbone_with(levels_v=(0.3, 0.5, 0.8))
    runs = []
    for fused in (True, False):
        monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=fused))
        with rig.run(plan, bench=late_bench({"held_per_s": 0.5, "held_s": 0.014})) as run:
            runs.append(run.recording.points)
    assert runs[0] == runs[1]
    assert any(point.get("refused_before") for point in runs[0])


def test_a_disturbance_that_never_passes_ends_refused_and_says_how_often_it_was_tried():
    plan = backbone_with(levels_v=(0.5, 0.8), retries=3, record_periods=400)
    with rig.run(plan, bench=late_bench(ALWAYS)) as run:
        points = points_of(run.recording)
        skipped = run.recording.parts[-1].end["skipped"]
    for point in points:
        assert not point.accepted
        assert point.attempts == 4
        assert point.reason.endswith("; refused in 4 attempts")
    assert skipped.startswith("2 of 2 points skipped")


@pytest.mark.parametrize("wire", [None, "serial"])
def test_a_point_whose_held_outputs_break_the_settle_rule_says_that_they_were_held(wire):
    """Outputs are held for half a second, so long that the phase is off for as many periods as the rule averages."""
    plan = backbone_with(levels_v=(0.5, 0.8), retries=0, record_periods=100)
    every_sample = plan.controller.model_copy(update={"period_mean": False})  # it finds its way back more quickly
    plan = plan.model_copy(update={"controller": every_sample})
    faults = {"held_per_s": 0.7, "held_s": 0.5}
    with ExitStack() as stack:
        bench = late_bench(faults)
        if wire is not None:
            bench = stack.enter_context(emulated(bench, wire, lockstep=True, options={"queue_blocks": 2}))
        run = stack.enter_context(rig.run(plan, bench=bench))
        points = points_of(run.recording)
        shown = summarise_recording(run.recording)["messages"]
    assert points
    for point in points:
        assert not point.accepted
        assert re.search(r"outputs came too late: held in [1-9]\d* samples of \d+, `rig doctor --daq`", point.reason)
        assert "settle rule" not in point.reason
    assert Quality.REJECTED in {point.quality for point in points}  # given up before the rule is broken
    assert "held-outputs" in shown


def test_what_has_not_settled_is_not_tried_again():
    rule = SettleRule(longest_periods=39)
    with rig.run(backbone_with(levels_v=(0.5, 2.0), settle=rule), bench=bench_with()) as run:
        points = points_of(run.recording)
    assert [point.quality for point in points] == [Quality.NOT_SETTLED] * 2
    assert all(point.attempts == 1 for point in points)
    assert len(run.recording.parts) == 1


def test_what_is_refused_without_any_disturbance_is_not_tried_again():
    with rig.run(backbone_with(levels_v=(0.5,), **NO_TOLERANCE), bench=bench_with()) as run:
        (point,) = points_of(run.recording)
    assert point.quality is Quality.REJECTED
    assert point.attempts == 1
    assert len(run.recording.parts) == 1


def test_too_many_lost_samples_repeat_a_point_and_a_few_do_not():
    few, many = {"lost_per_s": 0.4, "lost_s": 0.0028}, {"lost_per_s": 0.15, "lost_s": 0.12}
    plan = backbone_with(levels_v=(0.3, 0.5, 0.8, 1.0, 1.3))
    limits = {"lost_s": 0.5}
    with rig.run(plan, bench=late_bench(few)) as run:
        points = points_of(run.recording)
        assert run.complete
        assert sum(point.lost_samples for point in points) > 0
        assert all(point.attempts == 1 for point in points)
    with rig.run(plan, bench=late_bench(many, limits=limits), seed=3) as run:
        points = points_of(run.recording)
        refused = [attempt for point in points for attempt in point.refused_before]
        assert run.complete
        assert any("samples were lost" in attempt.reason for attempt in refused)


def test_a_knock_that_breaks_the_settle_rule_is_followed_by_another_record_at_once(monkeypatch):
    knock(monkeypatch, 2, 2.0, 0.3)
    plan = plan_of("friction-beam", levels_m=(5e-5, 6e-5), start_v=0.05, record_periods=200)
    with rig.run(plan, bench=bench_with({"block": 5}, "friction-beam")) as run:
        first, second = points_of(run.recording)
    assert run.complete
    assert len(run.recording.parts) == 1
    assert [attempt.quality for attempt in first.refused_before] == [Quality.DISTURBED]
    assert "settle rule" in first.refused_before[0].reason
    assert second.attempts == 1


def test_a_stopped_run_with_repeated_points_is_resumed_to_all_of_them(tmp_path):
    """The first point's line asks for the stop; what was measured again before stays as it is."""

    class StopAfter(Silent):
        def __init__(self, points):
            self.left = points

        def point(self, point, number_done, total):
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt

    plan, output = backbone_with(levels_v=(0.3, 0.5, 0.8, 1.0), retries=6), tmp_path / "stopped.h5"
    with pytest.raises(KeyboardInterrupt):
        run_plan(plan, late_bench(LATE), output, RunOptions(progress=StopAfter(2)))
    with resume_run(output) as recording:
        assert recording.complete
        points = points_of(recording)
        assert len(recording.parts) >= 2
        assert any(point.refused_before for point in points)


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_loop_in_a_process_of_its_own_repeats_points_over_a_wire(wire):
    plan = plan_with(levels_v=(0.8,), record_periods=20)
    faults = {"held_per_s": 0.4, "held_s": 0.014}
    with (
        emulated(late_bench(faults), wire, lockstep=True, seed=1, options={"queue_blocks": 2}) as bench,
        rig.run(plan, bench=bench, seed=1) as run,
    ):
        points = points_of(run.recording)
        assert run.complete
        refused = [attempt for point in points for attempt in point.refused_before]
        assert refused
        assert all("outputs came too late" in attempt.reason for attempt in refused)
        assert run.recording.parts[-1].end["counters"]["output_held"] > 0


def again_at_the_end(plan, bench, seed=0):
    """Points and parts of a run, some of whose points were measured again in a further part."""
    with rig.run(plan, bench=bench, seed=seed) as run:
        return points_of(run.recording), run.recording.parts, run.complete


def test_short_points_are_measured_again_after_the_last_level_for_their_ramp_belongs_to_them():
    plan = load_plan("magnet-beam/backbone-short")
    points, parts, complete = again_at_the_end(plan, late_bench({"held_per_s": 0.3, "held_s": 0.014}))
    assert complete
    assert len(parts) > 1
    again = [point for point in points if point.refused_before]
    assert again
    for point in again:
        assert point.part == len(parts) - 1 or point.attempts <= plan.retries
        assert [attempt.part for attempt in point.refused_before] == list(range(point.attempts - 1))
        first = next(table for table in parts[0].points if table["number"] == point.number)
        assert not first["accepted"]
        assert point.refused_before[0].reason == first["reason"]
    assert [point for point in points if not point.refused_before and point.part != 0] == []


def test_a_continuous_backbone_goes_up_and_down_again_over_the_levels_that_are_missing():
    plan = load_plan("magnet-beam/continuous-backbone")
    points, parts, complete = again_at_the_end(plan, late_bench({"held_per_s": 0.25, "held_s": 0.014}))
    assert complete
    assert len(parts) == 2
    accepted_at_once = {table["number"] for table in parts[0].points if table["accepted"]}
    assert 0 < len(accepted_at_once) < 13
    for point in points:
        assert point.attempts == (1 if point.number in accepted_at_once else 2)
        assert point.part == point.attempts - 1
    truth = backbone(ONE_SIDED, [point.vibration.force_n for point in points])
    np.testing.assert_allclose(
        [point.modal.modal_frequency_hz for point in points], [t.frequency_hz for t in truth], rtol=1e-3
    )


def test_a_multisine_is_played_again_at_once():
    plan = load_plan("magnet-beam/multisine-1")
    plan = plan.model_copy(update={"realisations": 3, "periods": 3, "resolution_hz": 2.0 * plan.resolution_hz})
    with rig.run(plan, bench=late_bench({"held_per_s": 0.05, "held_s": 0.014})) as run:
        points = points_of(run.recording)
    assert len(run.recording.parts) == 1
    attempts = [attempt for point in points for attempt in point.refused_before]
    assert attempts
    assert all(attempt.frequency_hz is None and attempt.force_n is None for attempt in attempts)
    with rig.run(plan, bench=late_bench({})) as run:
        undisturbed = points_of(run.recording)
    for point, whole in zip(points, undisturbed, strict=True):
        assert point.accepted
        assert point.channel_rms == pytest.approx(whole.channel_rms, rel=0.02)


def test_a_knock_that_only_the_evaluation_sees_is_measured_again_after_the_last_level(monkeypatch, tmp_path):
    class UntilAgain(Silent):
        """The knocks are over when the run goes on for another attempt."""

        def remark(self, text):
            if text.startswith("repeating point"):
                monkeypatch.undo()

    knock(monkeypatch, 2, 2.0, 0.01)
    plan = plan_of("friction-beam", levels_m=(5e-5, 6e-5), start_v=0.05, record_periods=200)
    bench = bench_with({"block": 5}, "friction-beam")
    with run_plan(plan, bench, tmp_path / "knocked.h5", RunOptions(progress=UntilAgain())) as recording:
        first, second = points_of(recording)
        assert recording.complete
        assert len(recording.parts) == 2
        assert recording.parts[0].end["skipped"] == "1 of 2 points skipped: rejected (0.05 mm)"
        assert recording.parts[1].end["skipped"] == ""
    assert first.part == 1
    (attempt,) = first.refused_before
    assert "is not harmonic" in attempt.reason
    assert attempt.part == 0
    assert attempt.frequency_hz == pytest.approx(first.vibration.frequency_hz, rel=1e-4)
    assert second.part == 0
    assert second.attempts == 1


def test_show_says_what_was_refused_before_and_json_has_it(measured, capsys):
    summary = summarise_recording(measured.recording)
    again = [point for point in summary["points"] if point.get("refused_before")]
    refused = sum(len(point["refused_before"]) for point in again)
    assert summary["measured_again"].startswith("measured again: points ")
    assert summary["measured_again"].endswith(f"; {refused} attempts refused")
    json.dumps(summary)
    print_summary(summary)
    shown = capsys.readouterr().out
    assert summary["measured_again"] in shown
    assert len(re.findall(r" refused at 2[45]", shown)) == refused


def test_a_device_that_has_latched_meanwhile_is_left_alone(monkeypatch, tmp_path):
    """The emergency stop was pressed between the last level and the next attempt."""
    sessions = []

    @contextmanager
    def open_latched(*arguments, **keys):
        with open_session(*arguments, **keys) as session:
            session.latched = "the emergency stop has latched" if sessions else ""
            sessions.append(session)
            yield session

    remarks = []

    class Heard(Silent):
        def remark(self, text):
            remarks.append(text)

    monkeypatch.setattr("rig.campaigns.running.runner.open_session", open_latched)
    plan = load_plan("magnet-beam/backbone-short")
    options = RunOptions(progress=Heard())
    with run_plan(plan, late_bench(LATE), tmp_path / "latched.h5", options) as recording:
        assert len(recording.parts) == 1
        assert not recording.complete
    assert len(sessions) == 2
    assert any("emergency stop has latched" in text for text in remarks)
    monkeypatch.undo()
    with resume_run(tmp_path / "latched.h5") as recording:
        assert recording.complete


def test_a_sweep_is_one_attempt_and_swept_again_after_the_last_level():
    """So many outputs are held that no sweep can be accepted; each attempt is a part of the recording."""
    plan = load_plan("magnet-beam/sweep-1").model_copy(
        update={"start_hz": 22.0, "stop_hz": 27.0, "rate_hz_per_s": 1.0, "retries": 1}
    )
    points, parts, complete = again_at_the_end(plan, late_bench({"held_per_s": 2.0, "held_s": 0.06}))
    assert not complete
    assert len(parts) == 2
    (point,) = points
    assert point.reason.startswith("outputs came too late")
    assert point.reason.endswith("; refused in 2 attempts")
    assert point.refused_before[0].part == 0
    assert parts[1].end["skipped"].startswith("1 of 1 points skipped")
