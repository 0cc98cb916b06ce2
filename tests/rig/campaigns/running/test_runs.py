"""Runs that go wrong half-way: killed, interrupted, out of disk, out of reach, unlocked; and what is kept of them."""

import contextlib
import resource
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import rig
from controller import preset
from rig.arming.run_options import RunOptions, Silent
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.running.runner import run_plan
from rig.drivers.virtual.driver import VirtualDAQ
from rig.errors import ConfigurationError, DaqDisconnected, RecordingError
from rig.loop.loop import Loop
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from rig.tick.sequencer.segments import SettleRule
from tests.forking import FORKED
from tests.refused import refused
from tests.rig.rigs import bench_with
from tests.waiting import wait_until

LEVELS = (0.4, 0.8, 1.2, 1.6)


def plan_with(**changes):
    table = {
        "bench": "magnet-beam",
        "controller": preset("magnet-beam").model_dump(),
        "levels_v": LEVELS,
        "record_periods": 20,
    }
    return BackbonePlan.model_validate(table | changes)


@pytest.fixture(scope="module")
def whole():
    with rig.run(plan_with(), seed=1) as run:
        yield {point["number"]: point for point in run.recording.points}


CHILD = """
import signal
import sys
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever the tests are run by ignores
import rig
from tests.rig.campaigns.running.test_runs import plan_with
run = rig.run(plan_with(), output=sys.argv[1], seed=1, realtime=True)
sys.exit(0 if run.complete else 1)
"""


@contextlib.contextmanager
def running(script, output, points):
    """A script in a process of its own that writes a recording, once that holds some points; none outlives the test."""
    command = [sys.executable, "-c", FORKED + script, str(output)]
    with subprocess.Popen(command, cwd=Path(__file__).parents[4]) as child:
        try:
            # each look reads the whole journal
            wait_until(lambda: _holds(output, points) or child.poll() is not None, f"{points} points", every_s=0.1)
            assert child.poll() is None, "the run ended before it was to be stopped"
            yield child
        finally:
            child.kill()


def _holds(output, points):
    if not journal_path(output).exists():
        return False
    try:
        with Recording(output) as recording:
            return len(recording.points) >= points
    except RecordingError:
        return False


def _same_points(points, whole):
    assert sorted(points) == sorted(whole)
    for number, point in points.items():
        assert point["accepted"]
        assert point["frequency_hz"] == pytest.approx(whole[number]["frequency_hz"], rel=1e-4)
        assert point["amplitude_m"] == pytest.approx(whole[number]["amplitude_m"], rel=0.01)  # the settle tolerance
        assert point["damping_ratio"] == pytest.approx(whole[number]["damping_ratio"], rel=0.01)


def test_a_killed_run_keeps_its_rows_and_points_and_is_resumed_to_the_same_result(tmp_path, whole):
    output = tmp_path / "run.h5"
    with running(CHILD, output, 1) as child:
        with Recording(output) as recording:
            rows_seen, points_seen = recording.n_rows, len(recording.points)
            kept = recording.parts[0].read(0, rows_seen)
        child.kill()
        assert child.wait() == -signal.SIGKILL
    assert not output.exists()
    with Recording(output) as recording:
        assert recording.n_rows >= rows_seen
        assert len(recording.points) >= points_seen
        assert recording.parts[0].read(0, rows_seen).tobytes() == kept.tobytes()
        assert not recording.complete
    with rig.resume(output) as run:
        assert run.complete
        assert len(run.recording.parts) == 2
        assert run.recording.parts[1].first_sample >= rows_seen
        assert run.recording.parts[0].read(0, rows_seen).tobytes() == kept.tobytes()
        _same_points({point["number"]: point for point in run.recording.points}, whole)
    assert not journal_path(output).exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_ramps_down_closes_its_file_and_says_so(tmp_path, number):
    output = tmp_path / "run.h5"
    with running(CHILD, output, 1) as child:
        child.send_signal(number)
        assert child.wait() == 1
    with Recording(output) as recording:
        end = recording.parts[0].end
        assert end["reason"] == "stop_requested"
        assert not end["tripped"]
        assert recording.points[0]["accepted"]
        assert [point["reason"] for point in recording.points if not point["accepted"]] == ["interrupted"]
        output_v = recording.parts[0].rows("output_v")
        guard = recording.parts[0].rows("guard")
        events = [(event["what"], event["state"]) for event in recording.parts[0].events]
    assert events[:2] == [("lock", "acquiring"), ("lock", "locked")]
    assert [event for event in events if event[0] == "guard"] == [("guard", "ramping"), ("guard", "off")]
    assert abs(output_v[-1]) < 1e-3
    assert np.count_nonzero(guard == 2) == pytest.approx(2500, abs=2)  # half a second of ramp
    assert not journal_path(output).exists()


def test_a_full_disk_ends_the_run_safely_and_keeps_what_was_recorded(tmp_path):
    output = tmp_path / "run.h5"
    script = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "import rig\n"
        "from tests.rig.campaigns.running.test_runs import plan_with\n"
        "sys.dont_write_bytecode = True; rig.run(plan_with(), seed=1).close()\n"  # kernels compiled before the disk is full
        "resource.setrlimit(resource.RLIMIT_FSIZE, (2_500_000, 2_500_000))\n"
        "try:\n"
        "    rig.run(plan_with(), output=sys.argv[1], seed=1)\n"
        "except rig.errors.RecordingError as error:\n"
        "    print(error)\n"
        "    sys.exit(7)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", FORKED + "import rig.errors\n" + script, str(output)],
        cwd=Path(__file__).parents[4],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 7, done.stderr
    assert str(output) in done.stdout
    assert len(done.stdout.strip().splitlines()) == 1
    with Recording(output) as recording:
        assert recording.n_rows > 20_000
        assert not recording.complete
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 2_500_000
    with rig.resume(output) as run:
        assert run.complete


def test_a_level_beyond_the_voltage_limit_is_refused_before_anything_moves(tmp_path):
    with refused(ConfigurationError, "the-bench-magnet-beam-allows-up-3", field="levels_v[3]", value=9.75):
        rig.run(plan_with(levels_v=(0.1, 0.2, 0.3, 9.75)), output=tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_force_that_the_voltage_limit_does_not_reach_is_marked_and_the_rest_goes_on(tmp_path):
    law = preset("magnet-beam").model_dump() | {"k3": 0.0, "k4": 10.0}
    plan = plan_with(levels_v=None, levels_n=(0.06, 0.56), controller=law)
    bench = bench_with({"limits": {"voltage_v": 1.0}})
    with run_plan(plan, bench, tmp_path / "run.h5", RunOptions(seed=1)) as recording:
        first, second = recording.points
    assert first["accepted"]
    assert first["force_n"] == pytest.approx(0.06, rel=0.01)
    assert not second["settled"]
    assert "out of reach" in second["reason"]
    assert "frequency_hz" not in second


OFF_RESONANCE = preset("magnet-beam").model_dump() | {"centre_frequency_hz": 29.0, "frequency_window_hz": (28.0, 30.0)}
MISTAKEN = {"specimen": {"linear_frequency_hz": 29.0}}


def test_a_window_that_does_not_hold_the_tested_mode_is_refused(tmp_path):
    with refused(
        ConfigurationError, "linear-frequency-hz-2", field="controller.frequency_window_hz", value=[28.0, 30.0]
    ):
        run_plan(plan_with(controller=OFF_RESONANCE), bench_with(), tmp_path / "run.h5")


def test_a_start_outside_the_pull_in_range_gives_no_point(tmp_path):
    settle = SettleRule(longest_periods=80).model_dump()
    plan = plan_with(controller=OFF_RESONANCE, settle=settle)
    with run_plan(plan, bench_with(MISTAKEN), tmp_path / "run.h5") as recording:
        assert not recording.complete
        assert all(not point["settled"] and "frequency_hz" not in point for point in recording.points)


@pytest.mark.parametrize("channel", [0, 1])
def test_a_sensor_that_reads_only_noise_gives_no_point(tmp_path, monkeypatch, channel):
    exchange, noise = VirtualDAQ._exchange, np.random.default_rng(1)

    def dead(self, voltages, inputs):
        exchange(self, voltages, inputs)
        inputs[:, channel] = 1e-4 * noise.normal(size=len(inputs))

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", dead)
    settle = SettleRule(longest_periods=100).model_dump()
    bench = bench_with({"block": 10})
    with run_plan(plan_with(levels_v=(0.4,), settle=settle), bench, tmp_path / "run.h5") as recording:
        assert not recording.complete
        assert not any(point["accepted"] for point in recording.points)
        assert "frequency_hz" not in recording.points[0]


def test_skew_between_channels_is_taken_out_of_loop_and_points_alike(tmp_path, monkeypatch, whole):
    """The drive channel two samples late: declared, the points are those of a rig without skew."""
    exchange, late = VirtualDAQ._exchange, []

    def skewed(self, voltages, inputs):
        exchange(self, voltages, inputs)
        drive = np.concatenate([late[-1] if late else np.zeros(2), inputs[:, 1]])
        late.append(drive[-2:].copy())
        inputs[:, 1] = drive[:-2]

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", skewed)
    channels = [channel.model_dump() for channel in bench_with().channels]
    channels[1]["skew_samples"] = 2.0
    bench = bench_with({"channels": channels, "block": 10})
    with run_plan(plan_with(), bench, tmp_path / "run.h5", RunOptions(seed=1)) as recording:
        points = {point["number"]: point for point in recording.points}
    _same_points(points, whole)


@pytest.mark.parametrize("gains", [{"k1": 100.0, "k2": 600.0}, {"k1": 300.0, "k2": 600.0}])
def test_a_loop_that_hunts_is_not_accepted(tmp_path, gains):
    law = preset("magnet-beam").model_dump() | gains
    with run_plan(plan_with(levels_v=(0.3,), controller=law), bench_with(), tmp_path / "run.h5") as recording:
        assert not recording.complete
        assert not recording.points[0]["accepted"]


def test_an_output_that_has_not_reached_its_level_does_not_settle(tmp_path):
    bench = bench_with({"limits": {"slew_v_per_s": 0.001}})
    settle = SettleRule(longest_periods=100).model_dump()
    with run_plan(plan_with(levels_v=(2.0,), settle=settle), bench, tmp_path / "run.h5") as recording:
        assert not recording.points[0]["settled"]


@pytest.mark.parametrize("options", [{}, {"queue_blocks": 4}, {"delay_samples": 1000}])
@pytest.mark.parametrize("block", [1, 500])
def test_the_ramp_reaches_the_converter_before_the_run_ends(tmp_path, block, options):
    law = preset("magnet-beam").model_dump() | {"k1": 0.5, "k2": 0.5}
    settle = SettleRule(longest_periods=60).model_dump()
    plan = plan_with(levels_v=(1.0,), controller=law, settle=settle)
    with run_plan(plan, bench_with({"block": block}, **options), tmp_path / "run.h5") as recording:
        assert np.abs(recording.parts[0].rows("command_v")).max() > 0.9
        assert recording.parts[0].rows("command_v")[-1] == 0.0
        assert recording.parts[0].rows("output_v")[-1] == 0.0


class _Fails(Silent):
    def point(self, point, number, total):
        raise KeyError("a bug")


def test_a_failure_beside_the_loop_ramps_down_before_it_is_raised(tmp_path):
    output = tmp_path / "run.h5"
    with refused(KeyError, "a-bug"):
        run_plan(plan_with(), bench_with(), output, RunOptions(progress=_Fails()))
    with Recording(output) as recording:
        assert recording.parts[0].end["reason"] == "stop_requested"
        assert recording.parts[0].rows("command_v")[-1] == 0.0
        assert recording.points[0]["accepted"]
    with rig.resume(output) as run:
        assert run.complete


class _FailsAtTheEnd(Silent):
    def point(self, point, number, total):
        if number == total:
            raise KeyError("a bug")


def test_a_failure_at_the_last_point_leaves_no_run_that_calls_itself_complete(tmp_path):
    output = tmp_path / "run.h5"
    with refused(KeyError, "a-bug"):
        run_plan(plan_with(levels_v=(0.4,)), bench_with(), output, RunOptions(progress=_FailsAtTheEnd()))
    with Recording(output) as recording:
        assert not recording.complete


@pytest.mark.parametrize("before_the_end", [300, 1500])  # the last 205 samples are not evaluated
def test_a_sensor_that_dies_shortly_before_the_end_of_a_record_spoils_the_point(tmp_path, monkeypatch, before_the_end):
    plan = plan_with(levels_v=(0.4,))
    with run_plan(plan, bench_with({"block": 10}), tmp_path / "whole.h5", RunOptions(seed=1)) as recording:
        end = recording.points[0]["end_sample"]
    exchange, noise, count = VirtualDAQ._exchange, np.random.default_rng(1), 0

    def dying(self, voltages, inputs):
        nonlocal count
        exchange(self, voltages, inputs)
        count += len(inputs)
        if count > end - before_the_end:
            inputs[:, 0] = 1e-4 * noise.normal(size=len(inputs))

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", dying)
    with run_plan(plan, bench_with({"block": 10}), tmp_path / "run.h5", RunOptions(seed=1)) as recording:
        assert not recording.complete
        assert not recording.points[0]["accepted"]


def test_overwriting_keeps_the_old_file_until_the_new_one_is_begun_and_spares_what_is_not_ours(tmp_path, monkeypatch):
    output = tmp_path / "run.h5"
    rig.run(plan_with(levels_v=(0.4,)), output=output).close()
    before = output.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr("rig.campaigns.running.runner.JournalWriter.create", _cannot_create)
        with refused(RecordingError, "no-room"):
            rig.run(plan_with(levels_v=(0.4,)), output=output, overwrite=True)
    assert output.read_bytes() == before
    rig.run(plan_with(levels_v=(0.5,)), output=output, overwrite=True).close()
    assert output.read_bytes() != before
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]
    plan = tmp_path / "plan.toml"
    plan.write_text("mine")
    with refused(RecordingError, "not-file-of-vibrolock"):
        rig.run(plan_with(levels_v=(0.4,)), output=plan, overwrite=True)
    assert plan.read_text() == "mine"


def _cannot_create(*_):
    raise RecordingError("no room")


def test_a_reversed_sensor_gives_no_point_and_a_hint(tmp_path):
    channels = [channel.model_dump() for channel in bench_with().channels]
    channels[1]["sensitivity_v_per_unit"] *= -1
    settle = SettleRule(longest_periods=150).model_dump()
    plan = plan_with(levels_v=(0.4,), settle=settle)
    with run_plan(plan, bench_with({"channels": channels}), tmp_path / "run.h5") as recording:
        assert not recording.complete
        assert "polarity" in recording.points[0]["reason"]


def test_a_plan_whose_loop_never_locks_ends_at_the_first_level(tmp_path):
    settle = SettleRule(longest_periods=80).model_dump()
    plan = plan_with(controller=OFF_RESONANCE, settle=settle, on_failure="stop")
    with run_plan(plan, bench_with(MISTAKEN), tmp_path / "run.h5") as recording:
        assert recording.parts[0].end["reason"] == "no_lock_in_window"
        assert recording.points[0]["quality"] == "outside-window"


def test_a_trip_ends_the_run_and_the_file_names_channel_value_and_sample(tmp_path):
    bench = bench_with({"limits": {"displacement_m": 1.0e-3}})
    with run_plan(plan_with(), bench, tmp_path / "run.h5") as recording:
        end = recording.parts[0].end
        accepted = [point for point in recording.points if point["accepted"]]
    assert end["tripped"]
    assert "displacement above its limit" in end["text"]
    assert "sample" in end["text"]
    assert 0 < len(accepted) < len(LEVELS)


def test_a_device_that_disappears_ends_the_run_and_keeps_its_rows(tmp_path, monkeypatch):
    count = 0

    def vanish(self, voltages, inputs):
        nonlocal count
        count += 1
        if count > 2000:
            raise DaqDisconnected("virtual: unplugged; plug it in and resume")
        inputs[:] = 0.0

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", vanish)
    with run_plan(plan_with(), bench_with(), tmp_path / "run.h5") as recording:
        end = recording.parts[0].end
        assert end["reason"] == "driver_failed"
        assert "unplugged" in end["text"]
        assert recording.n_rows == 2000


def test_up_and_down_with_repeats_measures_every_level_in_its_direction(tmp_path):
    plan = plan_with(direction="up-down", repeats=2, levels_v=(0.4, 0.8))
    with rig.run(plan) as run:
        assert run.complete
        backbone = run.backbone()
    assert backbone.directions == ("up", "up", "down") * 2
    assert backbone.repeats == (1, 1, 1, 2, 2, 2)
    assert backbone.frequency_hz[0] == pytest.approx(backbone.frequency_hz[2], rel=2e-4)


def test_an_existing_file_is_not_overwritten_unasked(tmp_path):
    output = tmp_path / "run.h5"
    output.write_text("precious")
    with refused(RecordingError, "exists-already"):
        rig.run(plan_with(), output=output)
    assert output.read_text() == "precious"


def test_a_complete_recording_is_resumed_to_itself(tmp_path):
    output = tmp_path / "run.h5"
    rig.run(plan_with(levels_v=(0.4,)), output=output).close()
    before = output.read_bytes()
    with rig.resume(output) as run:
        assert run.complete
    assert output.read_bytes() == before


@pytest.mark.parametrize("evaluation", ["settled", "slow-flow"])
def test_to_resume_a_complete_recording_opens_no_device_and_says_that_nothing_is_missing(
    tmp_path, monkeypatch, evaluation
):
    output, told = tmp_path / "run.h5", []
    plan = plan_with(levels_v=(0.4,), evaluation=evaluation)
    rig.run(plan, output=output).close()
    before = output.read_bytes()

    def opened(*_, **__):
        raise AssertionError("a device was opened")

    progress = Silent()
    monkeypatch.setattr(progress, "remark", told.append, raising=False)
    monkeypatch.setattr("rig.campaigns.running.runner.open_session", opened)
    for change in (None, plan):
        with rig.resume(output, plan=change, progress=progress) as run:
            assert run.complete
    assert output.read_bytes() == before
    assert told == ["nothing is missing: the one point of the plan accepted, nothing is driven"] * 2


def test_the_same_seed_gives_the_same_recording_bit_for_bit(tmp_path):
    rows = []
    for name in ("a.h5", "b.h5"):
        with rig.run(plan_with(levels_v=(0.4,)), output=tmp_path / name, seed=9) as run:
            rows.append(run.recording.parts[0].read(0, run.recording.n_rows).tobytes())
    assert rows[0] == rows[1]
