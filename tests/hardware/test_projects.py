"""The plug-in in somebody's own project: what goes wrong there ends with a line, a rig at rest and no process left behind."""

import json
import os
import signal
import sys
import time

import pytest

from tests.docs.pages import ROOT, blocks
from tests.hardware.projects import alive, ended, started
from tests.waiting import LONG_S

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")

STRICT = "[pytest]\naddopts = --strict-markers --strict-config -p no:cacheprovider\nfilterwarnings = error\n"

OWN = """
import pytest
from rig.campaigns.plans import load_plan

@pytest.fixture
def rig_daq():
    return "mine"

def test_a_own_fixture_of_that_name(rig_daq):
    assert rig_daq == "mine"

def test_b_fails_half_way(armed_rig):
    armed_rig.run(load_plan("magnet-beam/backbone-short"))
    raise KeyError("half-way")

def test_c_goes_on(armed_rig):
    run = armed_rig.run(load_plan("magnet-beam/backbone-short"))
    assert run.complete
    armed_rig.notes({"force_n": run.backbone().force_n})
"""


@pytest.mark.slow
def test_the_example_of_the_page_and_a_strict_project_of_ones_own(tmp_path):
    page = ROOT / "docs" / "how-to" / "test-my-bench-with-pytest.md"
    (example,) = (block for block in blocks(page) if block.file == "test_bench.py")
    (tmp_path / "test_bench.py").write_text(example.text)
    (tmp_path / "test_own.py").write_text(OWN)
    (tmp_path / "pytest.ini").write_text(STRICT)
    status, text, result, found = ended(tmp_path)
    assert status == 1, text
    assert {name: outcome for name, (outcome, _) in found.items()} == {
        "test_the_magnets_move": "passed",
        "test_a_own_fixture_of_that_name": "passed",
        "test_b_fails_half_way": "failed",
        "test_c_goes_on": "passed",
    }
    assert found["test_b_fails_half_way"][1] == "KeyError: 'half-way'"
    measured = {name: value for test in result["tests"] for name, value in test["measured"].items()}
    assert 20.0 < measured["frequency_hz"] < 30.0
    assert min(measured["force_n"]) > 0.0
    assert not (tmp_path / ".pytest_cache").exists()


KILLED = """
import os, signal
from pathlib import Path

from rig.arming.run_options import Silent
from rig.campaigns.plans import load_plan

def test_a_emulator_dies_in_mid_run(armed_rig, monkeypatch):
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    (emulator,) = (int(c) for c in children if b"rig.emulator" in Path(f"/proc/{c}/cmdline").read_bytes())
    rows = []

    def advance(self, chunk, tick):
        if not rows:
            os.kill(emulator, signal.SIGKILL)
        rows.append(len(chunk))

    monkeypatch.setattr(Silent, "advance", advance)
    run = armed_rig.run(load_plan("magnet-beam/backbone-short"))
    assert rows
    end = run.recording.parts[-1].end
    assert not run.complete
    assert run.recording.n_rows == sum(rows)
    armed_rig.notes({"reason": end["reason"], "text": end["text"]})

def test_b_the_next_one_is_told(rig_daq):
    raise AssertionError
"""


@pytest.mark.parametrize("wire", ["serial", pytest.param("can", marks=pytest.mark.slow)])
def test_an_emulator_that_is_killed_ends_the_run_and_is_an_error_for_the_next_test(tmp_path, wire):
    (tmp_path / "test_own.py").write_text(KILLED)
    status, text, result, found = ended(tmp_path, "--rig-emulate", wire)
    assert status == 1
    assert found["test_a_emulator_dies_in_mid_run"] == ("passed", ""), text
    measured = result["tests"][0]["measured"]
    assert measured["reason"] == "driver_failed"
    assert "/dev/" in measured["text"]
    outcome, reason = found["test_b_the_next_one_is_told"]
    assert outcome == "error"
    assert "/dev/" in reason
    assert "Traceback" not in text


INTERRUPTED = """
from pathlib import Path

import numpy as np
from rig.arming.run_options import Silent
from rig.campaigns.plans import load_plan

def test_a(armed_rig, monkeypatch):
    monkeypatch.setattr(Silent, "advance", lambda self, rows, tick: Path("running").touch())
    try:
        armed_rig.run(load_plan("magnet-beam/backbone"))
    finally:
        part = armed_rig._runs[-1].recording.parts[-1]
        output = part.rows("output_v").astype(float)
        step = np.abs(np.diff(output)).max() / np.abs(output).max()
        Path("end").write_text(f"{part.end['reason']} {output[-1]} {step}")

def test_b():
    raise AssertionError("the session goes on after Ctrl-C")
"""


@pytest.mark.slow
def test_ctrl_c_in_mid_test_ramps_down_and_leaves_no_process(tmp_path):
    (tmp_path / "test_own.py").write_text(INTERRUPTED)
    process, mark = started(tmp_path, "--rig-emulate", "serial")
    try:
        while not (tmp_path / "running").exists():
            assert process.poll() is None, process.stdout.read()
            time.sleep(0.02)
        assert len(alive(mark)) >= 2
        os.killpg(process.pid, signal.SIGINT)
        text, _ = process.communicate(timeout=LONG_S)
    finally:
        process.kill()
        process.stdout.close()
    reason, last, step = (tmp_path / "end").read_text().split()
    assert (reason, float(last)) == ("stop_requested", 0.0)
    assert float(step) < 0.25
    assert process.returncode == pytest.ExitCode.INTERRUPTED, text
    assert "the rig is ramped down" in text
    assert json.loads((tmp_path / "result.json").read_text())["exit_status"] == pytest.ExitCode.INTERRUPTED
    assert alive(mark) == []


@pytest.mark.slow
def test_one_device_is_not_tested_by_two_processes_and_virtual_ones_are(tmp_path):
    pytest.importorskip("xdist")
    (tmp_path / "wired.toml").write_text(
        'base = "magnet-beam"\n[driver]\nname = "serial"\noptions.port = "/dev/nowhere"\n'
    )
    (tmp_path / "test_own.py").write_text("def test_a(rig_daq):\n    pass\n\ndef test_b(rig_bench):\n    pass\n")
    status, text, _, _ = ended(tmp_path, "-n", 2, "--rig-bench", "wired.toml")
    assert status == pytest.ExitCode.USAGE_ERROR
    assert text.strip().splitlines() == [
        "ERROR: bench magnet-beam: there is one device behind driver 'serial', and it is tested by one process; leave out -n"
    ]
    status, text, result, found = ended(tmp_path, "-n", 2)
    assert status == 0, text
    assert result["bench"] == "magnet-beam"
    assert found == {"test_a": ("passed", ""), "test_b": ("passed", "")}
