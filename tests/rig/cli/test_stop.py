"""``rig stop`` and ``rig watch`` from another process than the run's; the line that tells of them."""

import os
import pty
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from rig.live.place import runs
from rig.live.reader import LiveRun
from rig.tick.safety.layout import GuardMode
from tests.docs.pages import ROOT
from tests.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks of files of dead processes")

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8]
record_periods = 400

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""
RIG = [
    sys.executable,
    "-c",
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a shell's background job ignores it
    "from rig.cli import main; main()",
]


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    monkeypatch.setenv("VIBROLOCK_LIVE", str(tmp_path / "live"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path


@pytest.fixture
def running():
    """Start runs that take half a minute by the clock; wait until each is driven."""
    children = []

    def start(name):
        command = [*RIG, "run", "plan.toml", "--realtime", "-o", name]
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        children.append(child)
        wait_until(lambda: driven(name) or child.poll() is not None, f"{name} is driven")
        assert child.poll() is None, child.communicate()
        return child

    yield start
    for child in children:
        child.kill()
        child.communicate()


def driven(name):
    for folder in runs():
        with suppress(Exception), LiveRun(folder) as run:
            frame = run.frame()
            if run.facts.recording.endswith(name) and frame is not None:
                return frame.state["guard"] == GuardMode.ARMED and frame.state["voltage_v"] > 0.1
    return False


@pytest.mark.slow
def test_a_run_is_stopped_from_another_process_and_the_status_says_that_it_is_at_0_v(command, running):
    child = running("run.h5")
    began = time.monotonic()
    status, out, err = command("stop")
    took_s = time.monotonic() - began
    assert (status, err) == (0, "")
    assert re.fullmatch(r"\S+/run\.h5 \(process \d+\): output at 0 V\n", out)
    assert f"(process {child.pid})" in out
    text, _ = child.communicate(timeout=120)
    assert child.returncode == 1  # the plan was not completed
    assert re.search(r"stopped by `rig stop` \(process \d+\): 0 of 2 points accepted", text)
    assert took_s < 30.0


@pytest.mark.slow
def test_of_two_runs_the_named_one_is_stopped_and_then_all(command, running):
    one, other = running("one.h5"), running("other.h5")
    status, out, _ = command("stop one.h5")
    assert (status, out.count("\n")) == (0, 1)
    one.communicate(timeout=120)
    assert other.poll() is None
    assert driven("other.h5")
    another = running("another.h5")
    status, out, _ = command("stop")
    assert status == 0
    assert sorted(re.findall(r"(\w+)\.h5", out)) == ["another", "other"]
    for child in (other, another):
        child.communicate(timeout=120)
        assert child.returncode == 1


def test_without_a_run_one_line_says_so(command):
    assert command("stop") == (1, "", "rig: no run is under way\n")
    assert command("stop run.h5") == (1, "", "rig: run.h5: no run into this file is under way\n")
    assert command("stop run.h5 --all") == (1, "", "rig: run.h5: given with --all, allowed is one of the two\n")
    (status, out, err) = command("stop --timeout -1")
    assert (status, out) == (2, "")
    assert "timeout" in err


def test_a_run_that_does_not_answer_or_is_killed_wants_the_hardware_stop(command, running):
    child = running("run.h5")
    loop = [int(pid) for pid in children_of(child.pid)]
    os.kill(child.pid, signal.SIGSTOP)
    status, out, _ = command("stop --timeout 0.5")
    assert status == 1
    assert "not at 0 V within 0." in out
    assert out.endswith("USE THE HARDWARE STOP\n")
    stopping = subprocess.Popen([*RIG, "stop"], stdout=subprocess.PIPE, text=True)
    wait_until(lambda: "/frame\n" in Path(f"/proc/{stopping.pid}/maps").read_text(), "rig stop follows the run")
    child.kill()
    out, _ = stopping.communicate(timeout=120)
    assert stopping.returncode == 1
    assert "its process ended unexpectedly: USE THE HARDWARE STOP" in out
    wait_until(lambda: not any(alive(pid) for pid in loop), "the loop's process follows the run's")


def test_what_a_killed_run_has_left_is_named_and_wants_the_hardware_stop(command, running):
    child = running("run.h5")
    child.kill()
    child.communicate()
    for line in ("stop", "stop run.h5"):
        status, out, _ = command(line)
        assert status == 1
        assert out.endswith("its process ended unexpectedly: USE THE HARDWARE STOP\n")
    assert command("stop other.h5")[0] == 1


def children_of(pid):
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
def test_watching_in_plain_lines_begins_before_the_run_and_ends_with_it(command, running):
    watching = subprocess.Popen(
        [*RIG, "watch", "run.h5"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    )
    assert watching.stderr.readline() == "no run into run.h5 is under way; waiting\n"
    running("run.h5")
    begun = re.compile(r"[\d.]+ s  (searching|settling)  point 1 of 2  level 0\.\d+ V  ")
    assert any(begun.match(line) for line in watching.stdout)
    assert command("stop run.h5")[0] == 0
    out, err = watching.communicate(timeout=120)
    assert (watching.returncode, err) == (0, "")
    assert any(line.endswith("guard: ramping") for line in out.splitlines())
    assert re.search(r"end: stopped by `rig stop` \(process \d+\)", out)


def test_ctrl_c_ends_the_watching_and_leaves_the_run(running):
    child = running("run.h5")
    watching = subprocess.Popen([*RIG, "watch"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    watching.stdout.readline()
    watching.send_signal(signal.SIGINT)
    _, err = watching.communicate(timeout=120)
    assert (watching.returncode, err) == (0, "stopped watching; the run continues\n")
    assert child.poll() is None
    assert driven("run.h5")


def test_watching_a_run_that_is_killed_ends_with_status_1(running):
    child = running("run.h5")
    watching = subprocess.Popen([*RIG, "watch"], stdout=subprocess.PIPE, text=True)
    watching.stdout.readline()
    child.kill()
    out, _ = watching.communicate(timeout=120)
    assert watching.returncode == 1
    assert out.splitlines()[-1].endswith("USE THE HARDWARE STOP")


def on_a_terminal(*arguments):
    """Run a command with a terminal for all its streams; return its status and what it showed."""
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100", "LINES": "30"}
    child = subprocess.Popen(
        [*RIG, *arguments], stdin=follower, stdout=follower, stderr=follower, env=environment, start_new_session=True
    )
    os.close(follower)
    shown = b""
    with suppress(OSError):  # the terminal is gone with the last process that has it open
        while data := os.read(leader, 65536):
            shown += data
    os.close(leader)
    return child.wait(300), shown.decode(errors="replace")


@pytest.mark.slow
def test_a_run_on_a_terminal_says_how_to_watch_and_stop_it(command):
    _, shown = on_a_terminal("run", "magnet-beam/backbone-short", "-o", "run.h5")
    lines = [
        line for line in shown.splitlines() if line and " s] " not in line
    ]  # on a busy machine it says what it does
    assert lines[0] == "in another terminal, `rig watch` shows this run and `rig stop` ramps it down"
    assert "rig watch" not in command("run magnet-beam/backbone-short -o again.h5").err


@pytest.mark.slow
def test_on_a_terminal_a_run_is_drawn_and_its_end_stays_to_be_read(running):
    running("run.h5")
    stopping = subprocess.Popen(
        [sys.executable, "-c", "import time; time.sleep(3); from rig.cli import main; main()", "stop"]
    )
    status, shown = on_a_terminal("watch")
    assert stopping.wait(60) == 0
    assert status == 0
    assert "frequency" in shown
    assert " Hz" in shown
    last = shown.split("\x1b[?1049l")[-1]  # back on the screen that was there before
    assert "stopped by `rig stop`" in last


class Terminal:
    """A command on a terminal of its own, which can be typed on."""

    def __init__(self, *arguments):
        self.leader, follower = pty.openpty()
        self.child = subprocess.Popen(
            [*RIG, *arguments], stdin=follower, stdout=follower, stderr=follower, start_new_session=True
        )
        os.close(follower)
        self.shown = ""

    def until(self, text):
        while text not in self.shown:
            self.shown += os.read(self.leader, 65536).decode(errors="replace")

    def type(self, text):
        os.write(self.leader, text.encode())

    def close(self):
        with suppress(OSError):  # the terminal is gone with the last process that has it open
            while data := os.read(self.leader, 65536):
                self.shown += data.decode(errors="replace")
        os.close(self.leader)
        return self.child.wait(120)


@pytest.mark.slow
def test_on_a_terminal_two_runs_are_listed_and_the_chosen_one_is_stopped_or_all_unanswered(running):
    one, other = running("one.h5"), running("other.h5")
    terminal = Terminal("stop")
    terminal.until("Which one?")
    listed = re.search(r"(\d)  \S+/one\.h5 \(process \d+\): backbone on magnet-beam, since ", terminal.shown)
    terminal.type("7\n")
    terminal.until("'7' is none of 1 to 2; which one?")
    terminal.type(f"{listed[1]}\n")
    assert terminal.close() == 0
    assert re.findall(r"(\w+)\.h5 \(process \d+\): output", terminal.shown) == ["one"]
    one.communicate(timeout=120)
    assert driven("other.h5")
    another = running("another.h5")
    began = time.monotonic()
    silent = Terminal("stop")
    assert silent.close() == 0
    assert time.monotonic() - began > 5.0
    assert "no answer: all are stopped" in silent.shown
    assert sorted(re.findall(r"(\w+)\.h5 \(process \d+\): output", silent.shown)) == ["another", "other"]
    for child in (other, another):
        child.communicate(timeout=120)


@pytest.mark.slow
def test_all_are_stopped_without_a_question_by_all(running):
    running("one.h5"), running("other.h5")
    terminal = Terminal("stop", "--all")
    assert terminal.close() == 0
    assert "Which one?" not in terminal.shown
    assert len(re.findall("output at 0 V", terminal.shown)) == 2
