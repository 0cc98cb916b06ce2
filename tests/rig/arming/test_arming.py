"""Who may let something physical move, and what is recorded of it."""

import io
import json
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta

import pytest

import rig
from rig.arming.arming import ArmingRequest, asked_once, unguarded_text
from rig.arming.bench_memory import RememberedCheck, RememberedTrip, fingerprint, memory_of, memory_path, remember
from rig.arming.run_facts import About
from rig.arming.run_options import RunOptions
from rig.bench import Bench
from rig.check.run import check
from rig.cli.run_options import ask
from rig.daq import DAQ, Capabilities
from rig.errors import ConfigurationError, DaqDisconnected, DaqRefused, NotArmed, RecordingError
from rig.loop.session import LocalSession
from rig.recording.journal import journal_path
from rig.show.summary import summarise
from rig.show.tables import print_summary
from rig.tuning.tuning import tune
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.check.rewired import flipped, rewire
from tests.rig.rigs import bench_with

ESTOP = {"name": "estop", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0}
UNSAFE = {"largest_block": 1, "paced": True, "virtual": False, "repeatable": False}
DEVICE = {"serial_number": "7"}
PLAN = plan_with(levels_v=(0.4,), record_periods=4)


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    """A state folder of our own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def physical(monkeypatch):
    """Everything that is opened passes for something physical."""
    rewire(monkeypatch, None, virtual=False)


def bench(**arming):
    return bench_with({"name": "beam next door", "block": 50, "arming": arming})


def passed(chosen, hours_ago=0.0, failed=()):
    at = datetime.now(UTC) - timedelta(hours=hours_ago)
    return RememberedCheck(at.isoformat(), failed, "check.h5", fingerprint(chosen, DEVICE))


def armed(run):
    return run.recording.parts[-1].information["about"]["armed"]


def test_a_virtual_rig_arms_itself_and_nothing_is_remembered_of_it(tmp_path, state):
    with rig.run(PLAN, bench=bench()) as run:
        assert armed(run)["how"] == "virtual"
    check(bench(), tmp_path / "check.h5")
    assert not state.exists()


@pytest.mark.usefixtures("physical")
@pytest.mark.parametrize("arm", [None, False])
def test_nobody_has_armed_it_nothing_moves_and_the_line_says_how(tmp_path, arm):
    with refused(NotArmed, "beam-next-door-give-arm"):
        rig.run(PLAN, bench=bench(), output=tmp_path / "run.h5", arm=arm)
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.usefixtures("physical")
def test_a_word_given_beforehand_arms_and_is_recorded_with_what_spoke_against_it(monkeypatch):
    monkeypatch.setenv("VIBROLOCK_OPERATOR", "Ada")
    with rig.run(PLAN, bench=bench(), arm=True) as run:
        assert run.complete
        assert (armed(run)["how"], armed(run)["by"]) == ("switch", "Ada")
        assert "never checked" in armed(run)["cautions"][0]
        assert run.recording.parts[0].information["about"]["device"]["serial_number"] == "7"


@pytest.mark.usefixtures("physical")
def test_a_person_is_shown_bench_device_limits_and_check_and_types_the_name(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO("beam next door\n"))
    with rig.run(PLAN, bench=bench(), arm=ask) as run:
        assert armed(run)["how"] == "person"
    shown = capsys.readouterr().err
    for part in ("beam next door", "serial_number 7", "9.5 V, 34 N", "never", "CAUTION"):
        assert part in shown
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))
    with refused(NotArmed, "nothing-has-moved"):
        rig.run(PLAN, bench=bench(), arm=ask)


@pytest.mark.usefixtures("physical")
@pytest.mark.parametrize(
    ("remembered", "caution"),
    [
        (lambda b: passed(b), None),
        (lambda b: passed(b, failed=("polarity drive",)), "failed: polarity drive"),
        (lambda b: passed(b, hours_ago=25.0), "25.0 h old"),
        (lambda b: passed(b, hours_ago=-2.0), "2.0 h ahead of the clock"),
        (lambda b: replace(passed(b), fingerprint="another"), "other channels"),
        (lambda b: replace(passed(b), fingerprint=fingerprint(b, {"serial_number": "8"})), "another device"),
    ],
)
def test_an_automated_bench_arms_itself_only_with_a_check_that_counts(remembered, caution):
    chosen = bench(automated=True)
    remember(chosen, check=remembered(chosen))
    if caution is None:
        with rig.run(PLAN, bench=chosen) as run:
            assert armed(run)["how"] == "automated"
        return
    with refused(NotArmed, reason=lambda text: caution in text):
        rig.run(PLAN, bench=chosen)
    with rig.run(PLAN, bench=bench(automated=True, require_check=False)) as run:
        assert caution in armed(run)["cautions"][0]


@pytest.mark.usefixtures("physical")
def test_after_a_trip_an_automated_bench_waits_for_a_person(tmp_path):
    chosen = bench(automated=True, require_check=False)
    tight = chosen.model_copy(update={"limits": chosen.limits.model_copy(update={"acceleration_m_s2": 0.5})})
    with rig.run(PLAN, bench=tight) as run:
        assert run.recording.parts[-1].end["tripped"]
    with refused(NotArmed, "the-last-run-tripped-response-above"):
        rig.run(PLAN, bench=chosen)
    with refused(NotArmed, "nobody-has-seen-that-the-last"):
        rig.run(PLAN, bench=chosen, arm=True)
    assert memory_of(chosen).trip is not None
    with rig.run(PLAN, bench=chosen, arm=lambda request: "the last run tripped" in request.cautions[0]) as run:
        assert run.complete
        assert armed(run)["how"] == "person"
    with rig.run(PLAN, bench=chosen) as run:
        assert armed(run)["how"] == "automated"


@pytest.mark.usefixtures("physical")
@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        *(
            json.dumps({"check": {"at": at, "failed": [], "recording": "", "fingerprint": ""}, "trip": None})
            for at in ("yesterday", "2026-01-01T00:00:00", 5)
        ),
    ],
)
def test_what_cannot_be_read_may_have_been_a_trip(text):
    chosen = bench(automated=True, require_check=False)
    remember(chosen, trip=RememberedTrip("2026-01-01T00:00:00+00:00", "x", ""))
    memory_path(chosen).write_text(text)
    with refused(NotArmed, "cannot-be-read"):
        rig.run(PLAN, bench=chosen)


def test_a_check_needs_arming_and_is_remembered_with_what_failed(tmp_path, monkeypatch):
    rewire(monkeypatch, flipped("acc_magnet"), virtual=False)
    with pytest.raises(NotArmed):
        check(bench(), tmp_path / "check.h5")
    asked = []
    check(bench(), tmp_path / "check.h5", RunOptions(arm=lambda request: asked.append(request.what) or True))
    assert asked == ["check"]
    memory = memory_of(bench())
    assert memory.check.failed == ("polarity acc_magnet",)
    assert memory.check.recording == str(tmp_path / "check.h5")
    assert memory.check.fingerprint == fingerprint(bench(), DEVICE)


@pytest.mark.usefixtures("physical")
def test_a_run_is_compared_with_the_scale_of_the_last_check_and_says_once_where_there_is_none(tmp_path):
    def about(name):
        with rig.run(PLAN, bench=bench(), output=tmp_path / name, arm=True) as run:
            return run.recording.parts[-1].information["about"]

    never = about("never.h5")
    assert "checked" not in never
    assert sum("scale of force and motion" in r for r in never["remarks"]) == 1
    found = check(bench(), tmp_path / "check.h5", RunOptions(arm=True))
    checked = about("checked.h5")
    assert checked["checked"] == asdict(found.scale)
    assert not any("has not been checked" in remark for remark in checked["remarks"])
    remember(bench(), check=passed(bench()))  # as an earlier version kept it
    earlier = about("earlier.h5")
    assert any("did not record it" in remark for remark in earlier["remarks"])
    remember(bench(), check=replace(passed(bench()), fingerprint="of another device", scale=found.scale))
    assert any("other channels" in remark for remark in about("other.h5")["remarks"])


def test_a_memory_of_an_earlier_version_has_no_scale(state):
    remember(bench(), check=passed(bench()))
    path = memory_path(bench())
    table = json.loads(path.read_text())
    del table["check"]["scale"]
    path.write_text(json.dumps(table))
    assert memory_of(bench()).check.scale is None
    assert memory_of(bench()).trip is None


@pytest.mark.usefixtures("physical")
def test_a_bench_without_another_shape_says_that_the_phase_of_the_drive_sensor_cannot_be_checked(tmp_path):
    channels = [channel.model_dump() for channel in bench().channels]
    for channel in channels:
        channel["mode_shape"] = None
    alone = bench_with({"name": "beam next door", "block": 50, "channels": channels})
    with rig.run(PLAN, bench=alone, output=tmp_path / "run.h5", arm=True) as run:
        remarks = run.recording.parts[-1].information["about"]["remarks"]
    assert sum("phase of drive cannot be checked" in remark for remark in remarks) == 1


@pytest.mark.usefixtures("physical")
def test_tuning_asks_once_and_resuming_asks_again(tmp_path):
    with pytest.raises(NotArmed):
        tune(bench(), tmp_path / "tuned.h5")
    asked = []

    def yes(request):
        asked.append(request.what)
        return True

    with rig.run(PLAN, bench=bench(), output=tmp_path / "run.h5", arm=True):
        pass
    more = plan_with(levels_v=(0.4, 0.5), record_periods=4)
    with pytest.raises(NotArmed):
        rig.resume(tmp_path / "run.h5", plan=more)
    with rig.resume(tmp_path / "run.h5", plan=more, arm=yes, operator="Grace") as run:
        assert run.complete
        assert run.recording.parts[1].information["about"]["operator"] == "Grace"
    assert asked == ["backbone"]


def test_the_record_says_who_tested_what_and_that_a_calibration_is_over(tmp_path, capsys):
    channels = list(bench_with().model_dump()["channels"])
    channels[1] |= {"serial_number": "LW1234", "calibrated": "2020-02-01", "calibration_due": "2021-02-01"}
    output = tmp_path / "run.h5"
    told = {"operator": "Ada", "specimen_serial": "B-7", "notes": ["bolts at 20 N m", "stinger new"]}
    with rig.run(PLAN, bench=bench_with({"channels": channels}), output=output, **told):
        pass
    summary = summarise(output)
    assert {key: summary["parts"][0]["about"][key] for key in told} == told
    print_summary(summary)
    shown = capsys.readouterr().out
    for line in (
        "operator: Ada",
        "specimen serial: B-7",
        "stinger new",
        "channel drive: calibration was due on 2021-02-01",
    ):
        assert line in shown
    json.dumps(summary)


@pytest.mark.parametrize("key", ["calibrated", "calibration_due"])
def test_a_day_that_is_none_is_refused(key):
    channels = list(bench_with().model_dump()["channels"])
    channels[0][key] = "2026-02-30"
    with refused(ValueError, field=key, value="2026-02-30", allowed="a day as YYYY-MM-DD"):
        bench_with({"channels": channels})


def test_text_that_is_no_line_is_refused():
    with refused(ConfigurationError, field="note"):
        About(notes=("two\nlines",))


def test_a_check_counts_for_one_device_and_one_emergency_stop_behind_any_port():
    channels = list(bench_with().model_dump()["channels"])
    channels.append({"name": "estop", "role": "monitor", "unit": "V", "sensitivity_v_per_unit": 1.0})
    table = bench_with({"channels": channels}).model_dump()
    one, other = (
        Bench.model_validate({**table, "emergency_stop": {"channel": "estop", "below_v": v}}) for v in (2.5, 0.1)
    )
    assert fingerprint(one, DEVICE) != fingerprint(other, DEVICE)
    assert fingerprint(one, DEVICE) != fingerprint(one, {"serial_number": "8"})
    assert fingerprint(one, DEVICE) == fingerprint(one, {**DEVICE, "port": "elsewhere", "boot": "2"})


@pytest.mark.usefixtures("physical")
@pytest.mark.parametrize("word", [None, True])
def test_a_device_that_has_latched_waits_for_a_person(monkeypatch, capsys, word):
    monkeypatch.setattr(DAQ, "latched", "the device's watchdog had latched")
    chosen = bench(automated=True, require_check=False)
    with refused(NotArmed, "nobody-has-seen-that-the-device"):
        rig.run(PLAN, bench=chosen, arm=word)
    monkeypatch.setattr("sys.stdin", io.StringIO("beam next door\n"))
    with rig.run(PLAN, bench=chosen, arm=ask) as run:
        assert armed(run)["how"] == "person"
        assert armed(run)["cautions"][0] == "the device's watchdog had latched"
    assert "CAUTION  the device's watchdog had latched" in capsys.readouterr().err


@pytest.fixture
def outliving(monkeypatch):
    """A physical device that goes on putting out what it was given last when the host is killed."""
    rewire(monkeypatch, None, virtual=False, safe_without_host=False)


@pytest.mark.usefixtures("outliving")
@pytest.mark.parametrize("word", [None, True])
def test_an_output_that_outlives_the_host_is_not_armed_by_a_switch_or_by_itself(word):
    chosen = bench(automated=word is None, require_check=False)
    with refused(NotArmed, "driver-virtual-does-not-bring-the") as no:
        rig.run(PLAN, bench=chosen, arm=word)
    assert "\n" not in str(no.value)


@pytest.mark.usefixtures("outliving")
def test_where_nobody_said_anything_the_switch_that_would_be_refused_is_not_offered():
    with refused(NotArmed, "nobody-has-armed-it-by-itself") as caught:
        rig.run(PLAN, bench=bench())
    assert "give `arm`" not in str(caught.value)


@pytest.mark.usefixtures("outliving")
def test_a_person_who_is_told_that_the_output_outlives_the_host_may_arm(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO("beam next door\n"))
    with rig.run(PLAN, bench=bench(), arm=ask) as run:
        assert armed(run)["how"] == "person"
        assert "hardware emergency stop" in armed(run)["cautions"][0]
    assert "CAUTION  driver virtual" in capsys.readouterr().err


@pytest.mark.usefixtures("outliving")
@pytest.mark.parametrize("word", [None, True])
def test_a_hardware_emergency_stop_that_was_tested_stands_in_for_the_device(word):
    chosen = bench(automated=True, require_check=False, hardware_emergency_stop=True)
    with rig.run(PLAN, bench=chosen, arm=word) as run:
        assert armed(run)["how"] == ("switch" if word else "automated")
        assert not any("emergency stop" in caution for caution in armed(run)["cautions"])


def test_a_switch_that_the_host_reads_does_not_stand_in_for_the_device():
    channels = [*bench().model_dump()["channels"], ESTOP]
    stop = {"channel": "estop", "below_v": -50.0}
    chosen = Bench.model_validate({**bench().model_dump(), "channels": channels, "emergency_stop": stop})
    assert "hardware emergency stop" in unguarded_text(chosen, Capabilities(**UNSAFE))


def test_whoever_is_asked_once_is_asked_again_after_a_trip():
    asked = []
    once = asked_once(lambda request: asked.append(request.unseen) or len(asked) == 1)
    request = ArmingRequest(bench(), "check", {}, memory_of(bench()), ())
    assert [once(request), once(request)] == [True, True]
    assert once(replace(request, unseen=("the last run tripped: force",))) is False
    assert asked == [(), ("the last run tripped: force",)]


class Started:
    """A session whose device is started as wanted; notes what was there at that moment."""

    def __init__(self, monkeypatch, then):
        self.seen, real = [], LocalSession.start

        def start(session, settings):
            self.seen.append(memory_of(settings.bench).trip)
            return then(real, session, settings)

        monkeypatch.setattr(LocalSession, "start", start)


def as_ever(real, session, settings):
    return real(session, settings)


def refused_by(real, session, settings):
    raise DaqRefused("no room on the bus")


def failing_at_stop(real, session, settings):
    """A loop whose driver fails when it is stopped, once all rows are there."""
    loop = real(session, settings)
    rows = loop.run

    def run():
        yield from rows()
        loop.failure = DaqDisconnected("gone while it was stopped")

    loop.run = run
    return loop


@pytest.mark.usefixtures("physical")
def test_while_something_physical_runs_that_is_remembered_and_an_orderly_end_takes_it_back(monkeypatch):
    started = Started(monkeypatch, as_ever)
    with rig.run(PLAN, bench=bench(), arm=True):
        assert "its end was never recorded" in started.seen[0].text
        assert memory_of(bench()).trip is None


@pytest.mark.usefixtures("physical")
def test_a_stop_by_request_is_an_orderly_end(monkeypatch):
    def stopped(real, session, settings):
        loop = real(session, settings)
        loop.request_stop("enough")
        return loop

    Started(monkeypatch, stopped)
    with rig.run(PLAN, bench=bench(), arm=True) as run:
        assert run.recording.parts[-1].end["text"] == "enough"
    assert memory_of(bench()).trip is None


@pytest.mark.usefixtures("physical")
def test_a_campaign_that_dies_leaves_a_caution(monkeypatch, tmp_path):
    def dies(execution, information):
        raise SystemExit(9)

    monkeypatch.setattr("rig.campaigns.running.runner.Execution.run", dies)
    with pytest.raises(SystemExit):
        rig.run(PLAN, bench=bench(), output=tmp_path / "run.h5", arm=True)
    with refused(NotArmed, "run-into-run-was-under-way"):
        rig.run(PLAN, bench=bench(automated=True, require_check=False))


@pytest.mark.usefixtures("physical")
def test_where_nothing_can_be_remembered_nothing_moves(monkeypatch, tmp_path):
    memory_path(bench()).with_name(memory_path(bench()).name + ".vibrolock-part").mkdir(parents=True)
    started = Started(monkeypatch, as_ever)
    output = tmp_path / "run.h5"
    with refused(RecordingError, "cannot-be-written"):
        rig.run(PLAN, bench=bench(), output=output, arm=True)
    assert not started.seen
    assert not output.exists()
    assert not journal_path(output).exists()


@pytest.mark.usefixtures("physical")
def test_a_driver_that_fails_when_it_is_stopped_has_not_completed_and_is_remembered(monkeypatch):
    Started(monkeypatch, failing_at_stop)
    with rig.run(PLAN, bench=bench(), arm=True) as run:
        end = run.recording.parts[-1].end
        assert not run.complete
        assert (end["completed"], end["reason"], end["tripped"]) == (False, "driver_failed", True)
        assert end["text"] == "the plan was carried out, but the driver failed at the end: gone while it was stopped"
    assert memory_of(bench()).trip.text == "gone while it was stopped"


@pytest.mark.usefixtures("physical")
def test_a_start_that_fails_leaves_the_earlier_recording_its_journal_and_no_trip(monkeypatch, tmp_path):
    output = tmp_path / "run.h5"
    with rig.run(PLAN, bench=bench(), output=output, arm=True):
        pass
    journal_path(output).write_bytes(b"VLJB left by an earlier run")
    before = output.read_bytes()
    Started(monkeypatch, refused_by)
    with pytest.raises(DaqRefused):
        rig.run(PLAN, bench=bench(), output=output, arm=True, overwrite=True)
    assert output.read_bytes() == before
    assert journal_path(output).read_bytes() == b"VLJB left by an earlier run"
    journal_path(output).unlink()
    with pytest.raises(DaqRefused):
        rig.resume(output, plan=plan_with(levels_v=(0.4, 0.5), record_periods=4), arm=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "state"]
    assert memory_of(bench()).trip is None


@pytest.mark.usefixtures("physical")
def test_nothing_is_started_that_cannot_be_recorded(monkeypatch, tmp_path):
    def full(path, header):
        raise RecordingError(f"{path}: cannot be created (No space left on device)")

    started = Started(monkeypatch, as_ever)
    monkeypatch.setattr("rig.campaigns.running.runner.JournalWriter.create", full)
    with refused(RecordingError, "no-space"):
        rig.run(PLAN, bench=bench(), output=tmp_path / "run.h5", arm=True)
    assert not started.seen
