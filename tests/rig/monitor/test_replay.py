"""A recording is replayed as it was: what is shown at a time is what the run showed then, and what the file holds there."""

import math
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import rig
from rig.arming.run_options import Silent
from rig.campaigns.evaluation.recorded import point_rows
from rig.campaigns.plans import load_plan
from rig.errors import RecordingError
from rig.live.layout import BIN_S, BINS
from rig.live.place import runs
from rig.live.reader import LiveRun
from rig.monitor.replay import Replay, ReplayState
from rig.monitor.shown import bins_json, shown_frame
from rig.monitor.words import point_cells, state_text
from rig.recording.conversion import finalise
from rig.recording.header import Header
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from rig.tick.safety.layout import GuardMode
from tests.recorded import recorded_at
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.rigs import bench_with

RATE = 5000.0


class Watching(Silent):
    """Keeps what a reader sees of a run by the clock."""

    def __init__(self):
        self.seen, self.run = [], None

    def advance(self, rows, tick):
        self.run = self.run or LiveRun(runs()[0])
        frame = self.run.frame()
        if frame is not None and (not self.seen or self.seen[-1][0].state["sample"] != frame.state["sample"]):
            self.seen.append((frame, shown_frame(frame, self.run.facts, self.run.lines(0)), len(self.run.lines(0))))


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """A recording, and what was to be seen of it while it was made."""
    if sys.platform == "win32":
        pytest.skip("locks of files of dead processes")
    watching, path = Watching(), tmp_path_factory.mktemp("watched") / "run.h5"
    plan, bench = plan_with(levels_v=(0.4, 0.8)), bench_with({"block": 20})
    rig.run(plan, bench=bench, output=path, realtime=True, progress=watching, operator="A. Person").close()
    with watching.run as run:
        yield path, watching.seen, run.lines(0), run.facts


def at(path, time_s):
    replay = Replay(path, at_end=True)
    replay.seek(time_s)
    return replay


@pytest.mark.slow
def test_the_facts_are_those_of_the_run(watched):
    """But for what a run does not know when it is published: how it will be armed, and when its recording is begun."""
    path, _, _, facts = watched
    later = {"process": 0, "armed": "", "started": ""}
    with at(path, 0.0) as replay:
        assert replace(replay.facts, **later) == replace(facts, **later)
        assert replay.facts.armed == "virtual"


def test_what_is_shown_at_a_time_is_what_was_shown_then(watched):
    """Level, place in the plan, lock and guard are equal; what the run took from its detector agrees within it."""
    path, seen, _, _ = watched
    compared = 0
    with Replay(path, at_end=True) as replay:
        for frame, before, _ in seen[::3]:
            replay.seek(int(frame.state["sample"]) / RATE)
            now = shown_frame(replay.frame(), replay.facts, replay.lines(0))
            if before.details.guard != "armed" or before.state != now.state:
                continue  # a sample beside a change
            compared += 1
            for key in ("lock", "guard", "part", "points", "output_off"):
                assert getattr(now.details, key) == getattr(before.details, key), key
            assert now.details.point == before.details.point
            assert now.details.time_s == before.details.time_s
            assert now.details.frequency_hz == pytest.approx(before.details.frequency_hz, rel=5e-3)
            assert now.details.target == pytest.approx(before.details.target)
            voltage_v = before.details.voltage_v  # a row has what is on the converter
            assert now.details.voltage_v == pytest.approx(voltage_v, abs=0.01)
            assert now.details.level == pytest.approx(before.details.level, abs=0.01)
            if before.state == "recording":
                assert now.details.force_n == pytest.approx(before.details.force_n, rel=0.1)
                assert now.details.displacement_mm == pytest.approx(before.details.displacement_mm, rel=0.05)
            for one, other in zip(now.details.shares, before.details.shares, strict=True):
                assert (one.name, one.what) == (other.name, other.what)
                if math.isfinite(other.share) and math.isfinite(one.share):
                    assert one.share == pytest.approx(other.share, rel=0.05, abs=0.001)
    assert compared > 0.9 * sum(before.details.guard == "armed" for _, before, _ in seen[::3])


def test_lines_come_in_the_order_and_at_the_time_of_their_samples(watched):
    path, _, lines, _ = watched
    with Replay(path, at_end=True) as replay:
        end = replay.lines(0)
        assert [line["is"] for line in end].count("point") == 2
        assert sorted(map(str, end)) == sorted(map(str, lines))  # the whole of it, no more
        assert end[-1]["is"] == "end"
        for line in (line for line in end if line["is"] == "event" and line["sample"] > 0):
            replay.seek((line["sample"] - 2) / RATE)
            assert line not in replay.lines(0)
            replay.seek((line["sample"] + 2) / RATE)
            assert line in replay.lines(0)
        for line in (line for line in end if line["is"] == "point"):
            replay.seek(line["end_sample"] / RATE - 0.01)
            assert line not in replay.lines(0)
            replay.seek(line["end_sample"] / RATE + 0.01)
            assert line in replay.lines(0)
            assert replay.lines(len(replay.lines(0)) - 1) == replay.lines(0)[-1:]


def test_bins_hold_the_least_and_greatest_of_the_rows_within_them(watched):
    path, _, _, _ = watched
    with Replay(path, at_end=True) as replay, Recording(path) as recording:
        first, bins = replay.bins(0)
        rows = recording.parts[0].read(0, recording.n_rows)
        width = round(BIN_S * RATE)
        assert (first, bins.size) == (0, rows.size // width)
        np.testing.assert_allclose(bins["end_s"], BIN_S * np.arange(1, bins.size + 1))
        inputs = rows["inputs"][: bins.size * width].reshape(bins.size, width, -1)
        np.testing.assert_array_equal(bins["inputs"][:, :, 0], inputs.min(axis=1))
        np.testing.assert_array_equal(bins["inputs"][:, :, 1], inputs.max(axis=1))
        replay.seek(3.05)
        assert replay.bins(0)[1].size == 30
        np.testing.assert_array_equal(replay.bins(12)[1], bins[12:30])
        assert replay.bins(12)[0] == 12
        bins_json(0, bins, replay.facts)


def test_the_frame_of_a_record_says_what_its_point_does(watched):
    path, _, _, _ = watched
    with Replay(path, at_end=True) as replay, Recording(path) as recording:
        for point in recording.points:
            replay.seek(point["end_sample"] / RATE - 0.05)
            frame = replay.frame()
            shown = shown_frame(frame, replay.facts, replay.lines(0))
            assert (shown.state, shown.details.point) == ("recording", point["number"] + 1)
            assert shown.details.force_n == pytest.approx(point["force_n"], rel=0.01)
            assert shown.details.frequency_hz == pytest.approx(point["frequency_hz"], rel=2e-3)
            np.testing.assert_array_equal(frame.window[-50:], point_rows(recording, point["number"])[-300:-250])
            assert shown.details.settled is None
            assert all(math.isnan(value) for value in shown.details.late_us)
            assert shown.details.left_s == pytest.approx(replay.duration_s - replay.time_s)
            state_text(shown, replay.facts)


def test_it_plays_by_the_clock_pauses_seeks_and_ends(watched):
    path, _, _, _ = watched
    with Replay(path, speed=4.0) as replay:
        began = time.monotonic()
        time.sleep(0.3)
        low, now, high = time.monotonic() - began, replay.time_s, 0.0
        high = time.monotonic() - began
        assert 4.0 * low <= now <= 4.0 * high + 0.4
        replay.pause()
        held = replay.time_s
        time.sleep(0.05)
        assert (replay.time_s, replay.playing) == (held, False)
        before = replay.generation
        replay.seek(2.0)
        assert (replay.time_s, replay.generation, replay.playing) == (2.0, before + 1, False)
        replay.set_speed(1000.0)
        replay.play()
        time.sleep(0.1)
        assert replay.replay_state() == ReplayState(replay.duration_s, replay.duration_s, playing=False, speed=1000.0)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert (shown.state, shown.cause) == ("finished", "the plan was carried out")
        replay.set_speed(1.0)
        replay.play()
        assert replay.time_s < 1.0  # from the beginning again
        replay.seek(-5.0)
        assert replay.time_s < 1.0
        replay.seek(1e9)
        assert replay.time_s == replay.duration_s
        assert replay.connected
    assert not replay.connected


@pytest.mark.parametrize(("action", "value"), [("arm", 1.0), ("speed", 0.0), ("speed", 2000.0), ("seek", math.nan)])
def test_a_page_can_do_no_more_than_it_should(watched, action, value):
    with Replay(watched[0]) as replay, refused(ValueError, "arm-speed-number"):
        replay.control(action, value)


def test_what_a_page_asks_for_is_done(watched):
    with Replay(watched[0]) as replay:
        replay.control("pause", 0.0)
        replay.control("seek", 3.0)
        replay.control("speed", 7.0)
        assert (replay.playing, replay.time_s, replay.speed) == (False, 3.0, 7.0)
        replay.control("play", 0.0)
        assert replay.playing


def test_there_is_nothing_to_stop_and_no_speed_of_nothing(watched):
    with Replay(watched[0]) as replay, refused(RecordingError, "there-is-nothing-to-stop"):
        replay.request_stop("please")
    for speed in (0.0, -1.0, math.nan, 1001.0):
        with refused(RecordingError, field="speed"):
            Replay(watched[0], speed)


KINDS = ["backbone-short", "continuous-backbone", "multisine-1", "sweep-1", "stepped-phase-fast", "stepped-sine-up"]


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_replayed_with_its_segments_and_points(name, tmp_path):
    plan = load_plan(f"magnet-beam/{name}")
    recorded_at(tmp_path / "run.h5", plan)
    with Replay(tmp_path / "run.h5", at_end=True) as replay:
        points = [line for line in replay.lines(0) if line["is"] == "point"]
        assert len(points) == len(plan.targets())
        assert all(len(point_cells(point, replay.facts)) > 3 for point in points)
        states = set()
        for time_s in np.linspace(0.0, replay.duration_s, 80 if name == "sweep-1" else 30):
            replay.seek(time_s)
            shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
            states.add(shown.state)
            if shown.state == "recording" and "end_sample" in points[0]:
                inside = [p for p in points if p["first_sample"] <= time_s * RATE < p["end_sample"]]
                assert not inside or shown.details.point in [p["number"] + 1 for p in inside]
        assert "recording" in states
        assert ("driven" in states) is (name in ("multisine-1", "sweep-1", "stepped-sine-up"))


def test_a_resumed_recording_with_another_plan_goes_on_in_its_parts(tmp_path):
    class Stop(Silent):
        def point(self, point, number_done, total):
            raise KeyboardInterrupt

    path = tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        rig.run(plan_with(levels_v=(0.4, 0.8)), output=path, progress=Stop())
    rig.resume(path, plan=plan_with(levels_v=(0.4, 0.8, 0.6))).close()
    with Recording(path) as recording, Replay(path, at_end=True) as replay:
        lengths = [part.n_rows / RATE for part in recording.parts]
        assert replay.duration_s == pytest.approx(sum(lengths))
        replay.seek(lengths[0] + 0.01)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert (shown.details.part, shown.details.time_s) == (2, pytest.approx(0.01, abs=1e-3))
        assert [line["is"] for line in replay.lines(0)].count("part") == 2
        last = recording.parts[1].points[-1]
        replay.seek(lengths[0] + last["end_sample"] / RATE - 0.05)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert (shown.state, shown.details.level) == ("recording", pytest.approx(last["level"], rel=1e-3))
        bins = replay.bins(0)[1]
        assert set(bins["part"]) == {1, 2}
        assert bins["end_s"][bins["part"] == 2][0] == pytest.approx(BIN_S)


def test_where_one_row_of_several_was_stored_the_time_is_still_that_of_the_samples(tmp_path):
    path, plan = tmp_path / "run.h5", plan_with(levels_v=(0.4, 0.8), rows="records")
    recorded_at(path, plan)
    with Recording(path) as recording, Replay(path, at_end=True) as replay:
        part = recording.parts[0]
        ends = [event["sample"] for event in part.events if event.get("state") == "off"]
        assert replay.duration_s * RATE == pytest.approx(ends[-1], abs=0.1 * RATE + 1)
        assert part.n_rows < 0.7 * replay.duration_s * RATE
        point = recording.points[1]
        lock = next(event for event in part.events if event.get("state") == "locked")
        replay.seek(lock["sample"] / RATE + 0.15)  # between the records
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert shown.details.lock == "locked"
        assert math.isnan(shown.details.force_n)
        assert shown.details.voltage_v == pytest.approx(0.4, rel=0.5)
        told = next(n for n, line in enumerate(replay._told) if line.get("number") == point["number"])
        replay.seek((replay._times[told] - 100) / RATE)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert (shown.state, shown.details.point) == ("recording", 2)
        assert shown.details.force_n == pytest.approx(point["force_n"], rel=0.02)
        bins = replay.bins(0)[1]
        np.testing.assert_allclose(np.diff(bins["end_s"]), BIN_S)


def rewritten(path, source, fields, *, end):
    """Write a recording anew with some fields of its rows alone, as an earlier version might have."""
    with Recording(source) as recording:
        (part,) = recording.parts
        dtype = np.dtype([(name, part.row_dtype[name]) for name in fields])
        rows = np.zeros(part.n_rows, dtype)
        for name in fields:
            rows[name] = part.rows(name)
        header = Header(
            kind=recording.kind,
            configuration=recording.configuration,
            channels=recording.channels,
            row_dtype=dtype,
            columns=[column for column in part.columns if column.name in fields],
            software_version="0.0.1",
            started=recording.started,
        )
        with JournalWriter.create(journal_path(path), header) as journal:
            journal.part({"first_sample": 0})  # nothing about operator, device and so on
            journal.rows(rows)
            for event in part.events:
                journal.event(event)
            for point in part.points:
                journal.point(point)
            if end:
                journal.end(part.end)
    if end:
        finalise(journal_path(path), path)


@pytest.mark.parametrize("end", [True, False])
def test_rows_of_an_earlier_version_and_a_journal_that_was_cut_short_are_replayed(watched, tmp_path, end):
    fields = ("inputs", "output_v", "theta_rad", "frequency_hz", "command_v", "lock", "guard")
    rewritten(tmp_path / "old.h5", watched[0], fields, end=end)
    with Replay(tmp_path / "old.h5", at_end=True) as replay:
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert shown.details.output_off
        assert shown.cause == ("the plan was carried out" if end else "")
        replay.seek(replay.duration_s / 2)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert math.isnan(shown.details.phase_error_deg)
        assert math.isnan(shown.details.target)
        assert 24.0 < shown.details.frequency_hz < 25.0
        assert replay.bins(0)[1].size > 10


def test_a_recording_of_a_trip_ends_with_its_cause(tmp_path):
    bench = bench_with({"limits": {"force_n": 0.08}})
    rig.run(plan_with(levels_v=(0.4, 0.8)), bench=bench, output=tmp_path / "run.h5").close()
    with Replay(tmp_path / "run.h5", at_end=True) as replay:
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert shown.state == "tripped"
        assert "force above its limit" in shown.cause
        guard = next(line for line in replay.lines(0) if line.get("state") == "ramping")
        replay.seek(guard["sample"] / RATE + 0.1)
        shown = shown_frame(replay.frame(), replay.facts, replay.lines(0))
        assert (shown.state, shown.details.guard) == ("tripped", "ramping down")
        assert replay.frame().state["guard"] == GuardMode.RAMPING


def test_no_more_bins_than_of_a_run_under_way_are_kept(watched, monkeypatch):
    monkeypatch.setattr("rig.monitor.replay.BINS", 20)
    assert BINS > 20
    with Replay(watched[0], at_end=True) as replay:
        count = int(replay.duration_s / BIN_S)
        first, bins = replay.bins(0)
        assert (first, bins.size) == (count - 20, 20)


def test_other_files_are_refused_in_a_line(tmp_path):
    (tmp_path / "text.h5").write_text("hello")
    with refused(RecordingError, "text"):
        Replay(tmp_path / "text.h5")
