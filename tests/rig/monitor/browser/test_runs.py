"""Runs of a virtual rig on the page in a real browser: followed to the end, and stopped in the middle."""

import os
import subprocess
import sys

import pytest

from rig.monitor.sources import chosen
from rig.recording.reader import Recording
from tests.forking import FORKED
from tests.rig.monitor.browser.test_browser import rows

PLAN = """\
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.3, 0.8, 1.4]
record_periods = 10
[controller]
detector = "two-phase"
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""
COMMAND = [sys.executable, "-c", f"{FORKED}from rig.cli.app import main; main()", "run"]
WATCH = """
window.seen = [];
const note = () => window.seen.push(document.querySelectorAll("#points tbody tr").length);
new MutationObserver(note).observe(document.body, { subtree: true, childList: true, characterData: true });
"""


@pytest.fixture
def begin(tmp_path, monkeypatch):
    """Begin a run in a process of its own."""
    monkeypatch.setenv("VIBROLOCK_LIVE", str(tmp_path / "live"))
    (tmp_path / "plan.toml").write_text(PLAN)
    begun = []

    def run(recording, *options):
        command = [*COMMAND, str(tmp_path / "plan.toml"), "-o", str(recording), *options]
        process = subprocess.Popen(
            command, env={**os.environ}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        begun.append(process)
        return process

    yield run
    for process in begun:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_backbone_is_followed_to_its_last_point(browser, serve, begin, tmp_path):
    recording = tmp_path / "backbone.h5"
    browser.open(serve(chosen(recording)))
    browser.is_connected("none")
    browser.run(WATCH)
    process = begin(recording)
    browser.shows("state", "finished")
    told, _ = process.communicate()
    assert process.returncode == 0, told
    browser.is_connected("over")
    browser.until(lambda: len(rows(browser)) == 3, "three points")
    counts = browser.run("return window.seen")
    assert counts == sorted(counts)
    with Recording(recording) as file:
        for row, point in zip(rows(browser), file.points, strict=True):
            assert f" {point['frequency_hz']:.4f} " in row


@pytest.mark.slow
def test_a_run_by_the_clock_is_stopped_after_its_first_point(browser, serve, begin, tmp_path):
    recording = tmp_path / "stopped.h5"
    browser.open(serve(chosen(recording)))
    process = begin(recording, "--realtime")
    browser.until(lambda: len(rows(browser)) == 1, "the first point")
    assert browser.text("state").lower() not in ("", "ramping down", "output at 0 v")
    browser.click("stop")
    browser.shows("stopping", "OUTPUT AT 0 V")
    told, _ = process.communicate()
    assert process.returncode != 0
    assert "stopped on the page" in told
    browser.shows("cause", "stopped")
