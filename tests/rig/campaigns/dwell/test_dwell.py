"""Dwell: means without a gap, rows stored thinly in between, cycles over all parts, alarm and abort on drift."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError

import rig
from rig.arming.run_options import Silent
from rig.bench import Bench, load_bench
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.dwell.points import DwellResult, Length, recorded_course, watch_drift
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.plans import load_plan
from rig.drivers.virtual.driver import VirtualDAQ
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import point_rows
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.campaigns.made_points import made_modal, made_point, made_vibration

SHORT = {"cycles": 750, "mean_s": 0.5, "record_every": 4, "telemetry_s": 0.02, "ramp_periods": 20.0}


def dwell(**changes):
    return DwellPlan.model_validate(load_plan("friction-beam/dwell").model_dump() | SHORT | changes)


@pytest.fixture(scope="module")
def thin():
    with rig.run(dwell(), seed=3) as run:
        yield run.recording


@pytest.fixture(scope="module")
def full():
    with rig.run(dwell(record_every=1), seed=3) as run:
        yield run.recording


def samples_of_rows(part):
    """The sample of every stored row, from the events alone, as docs/reference/file-format.md says."""
    out, changes = [], [event for event in part.events if event["what"] == "telemetry"]
    stops = [*(event["row"] for event in changes), part.n_rows]
    out.append(np.arange(stops[0]))
    for event, stop in zip(changes, stops[1:], strict=True):
        first = -(-event["sample"] // event["stride"]) * event["stride"]
        out.append(first + event["stride"] * np.arange(stop - event["row"]))
    return np.concatenate(out)


def test_means_follow_each_other_without_a_gap_and_add_up_to_the_cycles(full):
    points = list(full.latest.values())
    assert full.complete
    assert len(points) == dwell().n_means == 10
    ends = np.array([point["end_sample"] for point in points])
    gaps = np.array([point["first_sample"] for point in points[1:]]) - ends[:-1]
    assert gaps.max() <= 1  # the sample at which the sequencer moves on
    assert sum(point["cycles_in_mean"] for point in points) == pytest.approx(750, abs=0.5)
    course = recorded_course(full)
    assert np.all(np.diff(course.cycles) > 0)
    assert course.time_s == pytest.approx(course.cycles / course.frequency_hz, rel=1e-3)


def test_rows_stored_thinly_are_those_of_a_full_recording_and_results_are_the_same(thin, full):
    (part,), (whole,) = thin.parts, full.parts
    assert part.n_rows < 0.6 * whole.n_rows
    at = samples_of_rows(part)
    assert at.size == part.n_rows
    assert at[-1] < whole.n_rows
    for name in ("inputs", "theta_rad", "output_v", "segment"):
        np.testing.assert_array_equal(part.rows(name), whole.rows(name)[at])
    for number, point in full.latest.items():
        for key in ("frequency_hz", "damping_ratio", "amplitude_m", "cycles"):
            assert thin.latest[number][key] == point[key]


def test_rows_of_means_that_are_stored_in_full_are_found_and_others_are_refused(thin, full):
    for number in (0, 4, 8, 9):
        np.testing.assert_array_equal(point_rows(thin, number)["inputs"], point_rows(full, number)["inputs"])
    with refused(RecordingError, "point-nothing-was-recorded-of-it"):
        point_rows(thin, 1)


def test_a_dwell_by_time_lasts_as_long_as_it_says():
    with rig.run(dwell(cycles=None, duration_s=2.3), seed=3) as run:
        points = list(run.recording.latest.values())
        assert [point["seconds_in_mean"] for point in points] == pytest.approx([0.5, 0.5, 0.5, 0.5, 0.3])


class StopAfter(Silent):
    """Presses Ctrl-C once some points are there."""

    def __init__(self, points):
        self.left = points

    def point(self, point, number, total):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def test_cycles_count_on_after_an_interruption(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        rig.run(dwell(), output=tmp_path / "dwell.h5", seed=3, progress=StopAfter(4))
    with rig.resume(tmp_path / "dwell.h5") as run:
        assert run.complete
        assert len(run.recording.parts) == 2
        points = list(run.recording.latest.values())
        assert sum(point["cycles_in_mean"] for point in points) == pytest.approx(750, abs=0.5)
        middle_of_last = 750 - 0.5 * points[-1]["cycles_in_mean"]
        assert recorded_course(run.recording).cycles[-1] == pytest.approx(middle_of_last, abs=0.5)


def ageing(rate_per_s):
    table = load_bench("friction-beam").model_dump()
    table["driver"]["options"]["wear"] = {"frequency_per_s": [rate_per_s], "until_s": 60.0, "every_s": 0.1}
    return Bench.model_validate(table)


def test_the_course_is_that_of_a_softening_rig_by_harmonic_balance():
    bench = ageing(-2e-4)
    with rig.run(dwell(cycles=1500, mean_s=1.0, record_every=1), bench=bench, seed=3) as run:
        points = list(run.recording.latest.values())
    assert all(point["accepted"] for point in points)
    nominal = VirtualRig.model_validate(VirtualDAQ(bench).rig.model_dump())
    for point in points[::3]:
        middle_s = 0.5 * (point["first_sample"] + point["end_sample"]) / bench.sample_rate_hz
        truth = phase_resonance_backbone(nominal.worn(middle_s), amplitudes_m=[point["amplitude_m"]], harmonics=15)
        assert point["modal_frequency_hz"] == pytest.approx(truth.frequency_hz[0], rel=3e-5)
        assert point["damping_ratio"] == pytest.approx(truth.damping_ratio[0], rel=3e-3)


def test_an_abort_ramps_down_at_the_first_mean_beyond_it(tmp_path):
    plan = dwell(cycles=1500, alarm={"frequency": 5e-4}, abort={"frequency": 1e-3})
    with rig.run(plan, bench=ageing(-4e-4), output=tmp_path / "dwell.h5", seed=3) as run:
        recording = run.recording
        accepted = [point for point in recording.latest.values() if point["accepted"]]
        changes = np.array([point["frequency_change"] for point in accepted])
        assert not run.complete
        assert not recording.parts[-1].end["tripped"]
        assert "abort.frequency is 0.1 %" in recording.parts[-1].end["text"]
        assert changes[-1] < -1e-3 < changes[-2]
        alarmed = [any(text.startswith("alarm") for text in point["warnings"]) for point in accepted]
        assert alarmed == [bool(change < -5e-4) for change in changes]
        assert abs(recording.parts[-1].rows("output_v")[-1]) == 0.0


def mean(frequency_hz, *, quality=Quality.GOOD, force_n=2.0, amplitude_m=1e-4):
    return made_point(
        quality=quality,
        vibration=made_vibration(frequency_hz=frequency_hz, force_n=force_n, amplitude_m=amplitude_m),
        modal=made_modal(frequency_hz),
        result=DwellResult(length=Length(cycles_in_mean=100.0, seconds_in_mean=1.0)),
    )


def plan_of(unit="N", alarm=None, abort=None):
    limits = [
        SimpleNamespace(**{"frequency": None, "damping": None, "amplitude": None} | (one or {}))
        for one in (alarm, abort)
    ]
    return SimpleNamespace(level_unit=unit, alarm=limits[0], abort=limits[1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_change_is_warned_of_at_its_alarm_and_ends_the_test_at_its_abort(sign):
    plan = plan_of(alarm={"frequency": 0.01}, abort={"frequency": 0.02})
    first = mean(100.0)
    for change, alarmed, aborted in ((0.0099, False, False), (0.0101, True, False), (0.0201, True, True)):
        point, stop = watch_drift(plan, [first], mean(100.0 * (1.0 + sign * change)))
        assert point.result.changes.frequency_change == pytest.approx(sign * change)
        assert any("alarm.frequency is 1 %" in text for text in point.warnings or ()) == alarmed
        assert ("abort.frequency is 2 %" in stop) == aborted
        assert bool(stop) == aborted


def test_where_the_displacement_is_held_the_force_is_watched_instead():
    plan = plan_of("m", abort={"amplitude": 0.1})
    _, stop = watch_drift(plan, [mean(100.0)], mean(100.0, force_n=1.7))
    assert "changed by -15 %" in stop
    assert watch_drift(plan, [mean(100.0)], mean(100.0, amplitude_m=1.2e-4))[1] == ""


def test_a_mean_that_was_not_accepted_is_no_reference_and_stops_nothing_but_its_cycles_count():
    plan = plan_of(abort={"frequency": 0.02})
    bad = mean(90.0, quality=Quality.REJECTED)
    point, stop = watch_drift(plan, [bad], mean(100.0))
    assert not stop
    assert point.result.cycles == 150.0
    assert watch_drift(plan, [mean(100.0)], bad)[1] == ""
    assert watch_drift(plan, [bad, mean(100.0)], mean(97.0))[1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cycles": None}, {"says": "cycles-duration-s-exactly-one", "field": "cycles, duration_s"}),
        ({"duration_s": 10.0}, {"says": "cycles-duration-s-exactly-one-2", "field": "cycles, duration_s"}),
        ({"levels_m": [1e-4, 2e-4]}, {"field": "levels_m", "allowed": "exactly 1"}),
        ({"mean_s": 0.01}, {"field": "mean_s", "value": 0.01}),
        ({"cycles": None, "duration_s": 0.4}, {"field": "duration_s", "value": 0.4, "allowed": "from mean_s = 0.5 s"}),
        ({"abort": {"frequency": 2.0}}, {"field": "abort.frequency", "value": 2.0}),
        ({"cycles": 10**9}, {"field": "cycles", "allowed": "up to 10000"}),
        ({"repeats": 2}, {"field": "repeats", "value": 2}),
        ({"on_failure": "skip"}, {"field": "on_failure", "value": "skip"}),
        ({"on_lost_lock": "skip"}, {"field": "on_lost_lock", "value": "skip"}),
    ],
)
def test_plans_that_make_no_sense_are_refused(changes, message):
    with refused(ValidationError, **message):
        dwell(**changes)


def test_a_limit_on_a_damping_that_nobody_knows_is_refused():
    bench = load_bench("friction-beam")
    unknown = bench.model_copy(update={"specimen": bench.specimen.model_copy(update={"drive_mode_shape": None})})
    with refused(ConfigurationError, "the-damping-is-unknown", field="abort.damping", value=0.5):
        dwell(abort={"damping": 0.5}).check(unknown)
