"""The page beside a run: however it goes with the page, the run takes no harm."""

import subprocess
import sys

import pytest

from rig.cli import monitor_process as module
from rig.cli.monitor_process import monitor_process
from tests.refused import refused


def started(monkeypatch, code):
    """Let another program take the place of the page's server."""
    real = subprocess.Popen
    started = []

    def popen(command, **options):
        assert command[1:4] == ["-P", "-m", "rig.monitor"]
        started.append(real([sys.executable, "-c", code], **options))
        return started[-1]

    monkeypatch.setattr(module.subprocess, "Popen", popen)
    return started


def test_without_the_option_nothing_is_started(monkeypatch):
    monkeypatch.setattr(module.subprocess, "Popen", lambda *_, **__: pytest.fail("started"))
    with monitor_process(False):
        pass


def test_the_address_is_told_and_the_page_stays_until_it_has_lost_its_run(monkeypatch, capsys):
    (page,) = [started(monkeypatch, 'import os; print(\'{"address": "http://x"}\', flush=True); os.read(0, 1)')]
    with monitor_process(True):
        pass
    assert capsys.readouterr().err == "note: the page is at http://x\n"
    page[0].returncode = None
    assert page[0].wait() == 0  # its standard input has ended


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ('print(\'{"error": "no room"}\')', "note: the page cannot be started: no room\n"),
        ("raise SystemExit(3)", "note: the page cannot be started: it has ended at once\n"),
        ("print('Killed')", "note: the page cannot be started: it has ended at once\n"),
    ],
)
def test_a_page_that_cannot_be_started_is_told_of(monkeypatch, capsys, code, said):
    pages = started(monkeypatch, code)
    with monitor_process(True):
        run = "goes on"
    assert run == "goes on"
    assert capsys.readouterr().err == said
    pages[0].returncode = None
    pages[0].wait()


def test_where_no_process_can_be_had_the_run_goes_on(monkeypatch, capsys):
    def fail(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(module.subprocess, "Popen", fail)
    with monitor_process(True):
        pass
    assert capsys.readouterr().err == "note: the page cannot be started (Resource temporarily unavailable)\n"


def test_an_error_of_the_run_is_its_own(monkeypatch, capsys):
    pages = started(monkeypatch, 'print(\'{"address": "http://x"}\', flush=True)')
    with refused(ValueError, "of-the-run"), monitor_process(True):
        raise ValueError("of the run")
    assert "http://x" in capsys.readouterr().err
    pages[0].returncode = None
    pages[0].wait()
