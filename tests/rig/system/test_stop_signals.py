"""Signals before, between and after the loop: nothing is left half-made, nothing that is whole is called failed."""

import contextlib
import signal

import pytest
import typer

import rig
from rig.arming.run_options import RunOptions, Silent
from rig.bench import load_bench
from rig.campaigns.running.runner import run_plan
from rig.cli.run import _carry
from rig.recording.conversion import finalise
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from rig.system.stop_signals import Interrupted, Terminated, deferred, ended_in_order, escalating, stopping_on_signals
from tests.command import signals_as_they_were
from tests.rig.campaigns.running.test_runs import plan_with

PLAN = plan_with(levels_v=(0.4,))
BENCH = load_bench(PLAN.bench)


@pytest.fixture(autouse=True)
def handlers_as_they_were():
    with signals_as_they_were():
        yield


def raising(number, real):
    def first(*arguments, **options):
        signal.raise_signal(number)
        return real(*arguments, **options)

    return first


def test_a_signal_between_the_journal_and_the_loop_leaves_nothing_in_the_way(tmp_path, monkeypatch):
    real = JournalWriter.create

    def create(*arguments):
        with real(*arguments):
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("rig.campaigns.running.runner.JournalWriter.create", create)
    with pytest.raises(Terminated) as ended:
        rig.run(PLAN, output=tmp_path / "run.h5")
    assert (ended.value.code, ended.value.signal) == (128 + signal.SIGTERM, "SIGTERM")
    # The journal was made and never handed over: it holds no part, and is in nobody's way.
    monkeypatch.undo()
    with rig.run(PLAN, output=tmp_path / "run.h5") as run:
        assert run.complete


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGTERM, Terminated), (signal.SIGINT, Interrupted)])
def test_a_signal_while_the_journal_becomes_a_file_keeps_the_journal(tmp_path, monkeypatch, number, kind):
    output = tmp_path / "run.h5"
    with monkeypatch.context() as patch:
        patch.setattr("rig.campaigns.running.runner.finalise", raising(number, finalise))
        with pytest.raises(kind) as ended:
            rig.run(PLAN, output=output)
    assert ended.value.recorded is None
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5.journal"]
    with Recording(output) as recording:
        assert recording.complete
    with rig.resume(output) as run:
        assert run.complete
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_a_signal_once_the_file_is_there_says_so_and_the_command_succeeds(tmp_path, monkeypatch, capsys):
    output = tmp_path / "run.h5"
    monkeypatch.setattr("rig.campaigns.running.runner.forget_before", lambda path: signal.raise_signal(signal.SIGTERM))
    with pytest.raises(Terminated) as ended:
        rig.run(PLAN, output=output)
    assert ended.value.recorded == output
    again = RunOptions(overwrite=True)
    _carry("backbone", again, lambda watched: run_plan(PLAN, BENCH, output, watched), json=False)
    assert "1 of 1 points accepted" in capsys.readouterr().out
    signal.raise_signal(signal.SIGTERM)  # all is done: a run that succeeded is not ended by a signal


class Stopping(Silent):
    def advance(self, rows, tick):
        signal.raise_signal(signal.SIGTERM)


def test_a_run_that_did_not_complete_fails_whatever_signal_comes_at_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.campaigns.running.runner.forget_before", lambda path: signal.raise_signal(signal.SIGTERM))
    stopping = RunOptions(progress=Stopping())
    with pytest.raises(typer.Exit) as ended:
        _carry("backbone", RunOptions(), lambda _: run_plan(PLAN, BENCH, tmp_path / "run.h5", stopping), json=False)
    assert ended.value.exit_code == 1


def test_a_signal_while_the_last_point_is_evaluated_comes_after_the_end_of_the_journal(tmp_path, monkeypatch):
    output = tmp_path / "run.h5"
    monkeypatch.setattr("rig.campaigns.running.execution.skipped_summary", raising(signal.SIGTERM, lambda *_: ""))
    with pytest.raises(Terminated):
        rig.run(PLAN, output=output)
    with Recording(output) as recording:
        assert recording.complete
    assert journal_path(output).exists()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="this system has no terminal that closes")
def test_a_closed_terminal_that_was_to_be_ignored_from_the_start_stays_ignored():
    before, asked = signal.signal(signal.SIGHUP, signal.SIG_IGN), []
    try:
        with stopping_on_signals(asked.append), ended_in_order(), deferred():
            signal.raise_signal(signal.SIGHUP)
        assert asked == []
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ctrl_c_that_a_library_swallows_is_raised_again():
    with escalating() as signals:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signals.check()
        signals.check()  # once
