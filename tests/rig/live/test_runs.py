"""Whole runs: what watching costs them (nothing), how they heed a request to stop, and how long they say that they take."""

import errno
import json
import os
import signal
import sys
import time
from contextlib import nullcontext

import numpy as np
import pytest

import rig
from controller import LockState
from rig.arming.run_options import Silent
from rig.campaigns.running import runner
from rig.emulator.emulated import emulated
from rig.errors import DaqError, RigError
from rig.live.place import runs
from rig.live.reader import LiveRun
from rig.live.stopping import request_stop
from rig.live.time_left import time_left_s
from rig.loop.loop import Loop
from rig.monitor.shown import bins_json, shown_frame, shown_json, state_of
from rig.monitor.shutdown_monitor import ShutdownMonitor
from rig.tick.safety.layout import EndReason, GuardMode
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.rigs import bench_with

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks of files of dead processes")


def short_plan(**changes):
    return plan_with(**{"levels_v": (0.4, 0.8), **changes})


class Asking(Silent):
    """Asks for the stop once the rig is locked, as another process does; keeps the frames that can be read after that."""

    def __init__(self, cause="stopped by the test"):
        self.cause, self.remarks, self.frames, self.run = cause, [], [], None

    def advance(self, rows, tick):
        if self.run is None and int(rows["lock"][-1]) == LockState.LOCKED:
            self.run = LiveRun(runs()[0])
            self.run.request_stop(self.cause)
        if self.run is not None:
            self.frames.append(self.run.frame())

    def remark(self, text):
        self.remarks.append(text)


def assert_stopped_by_the_runs_own_ramp(recording, cause, ramp_down_s):
    (part,) = recording.parts
    assert part.end["text"] == cause
    assert part.end["reason"] == EndReason.STOP_REQUESTED.name.lower()
    guard, output = part.rows("guard"), part.rows("output_v")
    assert guard[-1] == GuardMode.OFF
    assert np.abs(output[guard == GuardMode.OFF]).max() < 1e-3  # what is still on its way to the converter
    assert output[-1] == 0.0
    ramp = np.count_nonzero(guard == GuardMode.RAMPING) / 5000.0
    assert ramp == pytest.approx(ramp_down_s, abs=0.01)


RUNS = {
    "virtual": {},
    "realtime": {"realtime": True},
    "serial": {},
    "can": {},
}


@pytest.mark.parametrize("how", RUNS)
def test_a_request_ramps_a_run_down_by_its_own_ramp(how, tmp_path):
    asking = Asking()
    bench = bench_with({"block": 20})

    def run(bench):
        plan = short_plan(record_periods=1000)  # a virtual run is over in no time
        with rig.run(plan, bench=bench, output=tmp_path / "run.h5", progress=asking, **RUNS[how]) as done:
            assert_stopped_by_the_runs_own_ramp(done.recording, "stopped by the test", bench.limits.ramp_down_s)

    if how in ("serial", "can"):
        with emulated(bench, how, seed=5, options={"queue_blocks": 2}) as reached:
            run(reached)
    else:
        run(bench)
    with asking.run as told:
        assert told.lines(0)[-1]["text"] == "stopped by the test"
        assert told.frame().state["guard"] == GuardMode.OFF
        shown = shown_frame(told.frame(), told.facts, told.lines(0))
    assert (shown.state, shown.details.output_off) == ("stopped", True)
    assert shown.cause == "stopped by the test"
    states = {state_of(frame) for frame in asking.frames}
    assert "ramping down" in states or how == "virtual"  # hundreds of times faster than a frame
    assert runs() == []


def test_a_request_left_while_kernels_are_compiled_is_heeded_before_anything_moves(monkeypatch, tmp_path):
    load = Loop._load_kernels

    def slow(loop):
        request_stop(runs()[0], "before it moved")
        time.sleep(0.5)
        load(loop)

    monkeypatch.setattr(Loop, "_load_kernels", slow)
    with rig.run(short_plan(), output=tmp_path / "run.h5") as done:
        assert done.recording.parts[0].end["text"] == "before it moved"
        assert not np.any(np.abs(done.recording.parts[0].rows("output_v")) > 0.0)


def test_a_request_left_between_two_parts_ends_the_run_without_another(monkeypatch, tmp_path):
    class OnlyOne(Asking):
        """Asks when the last point has been told."""

        def point(self, point, number_done, total):
            if number_done == total:
                request_stop(runs()[0], "no more")

        def advance(self, rows, tick):
            pass

    monkeypatch.setattr("rig.campaigns.running.execution.Execution.to_repeat", frozenset({0}))
    monkeypatch.setattr("rig.live.publisher.stopping_on_request", lambda folder, stop: nullcontext())
    heard = OnlyOne()
    with rig.run(short_plan(), output=tmp_path / "run.h5", progress=heard) as done:
        assert len(done.recording.parts) == 1
    assert "nothing is measured again: a stop was requested" in heard.remarks


def test_without_memory_a_run_goes_on_unpublished(monkeypatch, tmp_path):
    def full(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    heard = Asking()
    heard.advance = lambda rows, tick: None
    monkeypatch.setattr(os, "posix_fallocate", full)
    with rig.run(short_plan(), output=tmp_path / "run.h5", progress=heard) as done:
        assert done.complete
    assert any("No space left" in remark for remark in heard.remarks)


def rows_of(output, progress=None, **options):
    with rig.run(short_plan(), output=output, seed=4, progress=progress, **options) as done:
        assert done.complete
        (part,) = done.recording.parts
        assert part.dropped_bytes == 0
        return part.read(0, part.n_rows), part.end["loop"]["overruns"]


class Reading(Silent):
    """Starts readers of the run, one that never reads on and one under SIGSTOP."""

    def __init__(self, started):
        self.started, self.readers = started, []

    def advance(self, rows, tick):
        if not self.readers:
            self.readers = [self.started("tests.rig.live.lazy_reader", runs()[0]) for _ in range(2)]
            for reader in self.readers:
                assert reader.stdout.readline() == "reading\n"
            os.kill(self.readers[1].pid, signal.SIGSTOP)


def test_readers_that_never_read_or_are_stopped_cost_no_row(started, tmp_path):
    undisturbed, _ = rows_of(tmp_path / "alone.h5")
    watched, _ = rows_of(tmp_path / "watched.h5", Reading(started))
    assert watched.tobytes() == undisturbed.tobytes()


def test_time_left_is_near_what_is_then_taken(tmp_path):
    """From the third point on, when it is known how long settling takes: 20 % of what is left, or two seconds."""
    told = []

    class Timing(Silent):
        def advance(self, rows, tick):
            points = tick.arrays.segments["point"]
            at = int(tick.arrays.progress["segment"][0])
            if at < points.size:
                told.append((int(points[at]), tick.sample / 5000.0, time_left_s(tick.arrays)))

    with rig.run("magnet-beam/backbone", output=tmp_path / "run.h5", progress=Timing()) as done:
        took_s = done.recording.n_rows / 5000.0
    for point, at_s, left_s in told:
        factor = 0.2 if point >= 2 else 0.6
        assert left_s == pytest.approx(took_s - at_s, rel=factor, abs=2.0)
    assert len(told) > 50
    assert told[-1][2] < 1.0


class Watching(Silent):
    """Keeps every state that is shown."""

    def __init__(self):
        self.shown, self.run = [], None

    def advance(self, rows, tick):
        self.run = self.run or LiveRun(runs()[0])
        self.shown.append(shown_frame(self.run.frame(), self.run.facts, self.run.lines(0)))


@pytest.mark.slow
def test_the_states_of_a_run_come_one_after_the_other(tmp_path):
    watching = Watching()
    bench = bench_with({"block": 20})
    with rig.run(short_plan(), bench=bench, output=tmp_path / "run.h5", progress=watching, realtime=True) as done:
        points = done.recording.points
    order = list(dict.fromkeys(one.state for one in watching.shown))
    assert order[0] == "starting"
    known = [state for state in order if state in ("searching", "settling", "recording", "ramping down")]
    assert known == ["searching", "settling", "recording", "ramping down"]
    with watching.run as run:
        last = shown_frame(run.frame(), run.facts, run.lines(0))
        assert (last.state, last.details.guard) == ("finished", "output at 0 V")
        assert last.cause == "the plan was carried out"
        _, bins = run.bins(0)
        assert set(bins_json(0, bins, run.facts)) >= {"end_s", "frequency_hz", "force", "drive"}
    recording = [one for one in watching.shown if one.state == "recording" and one.details.point == 2]
    for one in recording:
        point = points[1]
        assert one.details.level == one.details.target == pytest.approx(0.8)
        assert one.details.voltage_v == pytest.approx(0.8, rel=1e-3)
        assert one.details.frequency_hz == pytest.approx(point["frequency_hz"], rel=1e-3)
        assert one.details.force_n == pytest.approx(point["force_n"], rel=0.05)
        assert one.details.displacement_mm == pytest.approx(1e3 * point["amplitude_m"], rel=0.05)
        shares = {(share.name, share.what): share for share in one.details.shares}
        assert shares["output", "limit"].share == pytest.approx(0.8 / bench.limits.voltage_v, rel=1e-3)
        travel = shares["drive", "displacement"]
        assert travel.value == pytest.approx(1e3 * point["amplitude_m"], rel=0.05)
        assert travel.of == pytest.approx(1e3 * bench.limits.displacement_m)
    assert recording
    settling = [one.details.settled for one in watching.shown if one.state == "settling"]
    assert max(good for good, _ in settling) > 0
    assert all(good <= needed for good, needed in settling)
    json.dumps([shown_json(one) for one in watching.shown])


def test_a_trip_is_told_with_channel_value_and_cause(tmp_path):
    watching = Watching()
    bench = bench_with({"block": 20, "limits": {"force_n": 0.08}})
    with rig.run(short_plan(), bench=bench, output=tmp_path / "run.h5", progress=watching, realtime=True) as done:
        text = done.recording.parts[0].end["text"]
    tripped = [one for one in watching.shown if one.state == "tripped"]
    assert tripped
    assert tripped[0].details.guard == "ramping down"
    assert not tripped[0].details.output_off
    assert tripped[0].cause.startswith("force above its limit on channel force: ")
    assert tripped[0].cause.endswith(" N")
    assert 0.08 < abs(float(tripped[0].cause.split()[-2])) < 0.12
    with watching.run as run:
        last = shown_frame(run.frame(), run.facts, run.lines(0))
    assert (last.state, last.details.output_off, last.cause) == ("tripped", True, text)


@pytest.mark.parametrize("realtime", [False, True])
def test_a_request_while_the_device_is_opened_keeps_the_rig_still_and_is_no_death(monkeypatch, tmp_path, realtime):
    """Found before its device is opened; nothing is driven and nothing recorded, and whoever watches is told so."""
    told: list[ShutdownMonitor] = []
    watching: list[LiveRun] = []
    opened = runner.open_session

    def asked_meanwhile(*arguments, **options):
        watching.append(LiveRun(runs()[0]))
        told.append(ShutdownMonitor(runs()[0], "stopped by a test"))
        return opened(*arguments, **options)

    monkeypatch.setattr(runner, "open_session", asked_meanwhile)
    output = tmp_path / "run.h5"
    with refused(RigError, "stopped-by-request-before-anything-was"):
        rig.run("magnet-beam/backbone", output=output, realtime=realtime)
    assert not list(tmp_path.glob("*run*"))
    outcome = told[0].outcome()
    assert outcome is not None
    assert outcome.at_0_v
    assert "before anything was driven" in outcome.text
    shown = shown_frame(watching[0].frame(), watching[0].facts, watching[0].lines(0))
    assert shown.state == "stopped"
    for one in (*told, *watching):
        one.close()


def test_a_run_that_cannot_begin_says_why_to_those_who_watch(monkeypatch, tmp_path):
    watching: list[LiveRun] = []

    def gone(*arguments, **options):
        watching.append(LiveRun(runs()[0]))
        raise DaqError("the port is gone")

    monkeypatch.setattr(runner, "open_session", gone)
    with pytest.raises(DaqError):
        rig.run("magnet-beam/backbone", output=tmp_path / "run.h5")
    assert watching[0].lines(0)[-1]["text"] == "the port is gone"
    watching[0].close()
