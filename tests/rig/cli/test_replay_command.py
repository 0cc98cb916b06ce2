"""``rig replay --terminal``: keys on a terminal, plain lines in a pipe."""

import os
import re
import select
import subprocess
import sys
import time

import pytest

from tests.docs.pages import ROOT
from tests.recorded import recorded_at
from tests.rig.campaigns.running.test_runs import plan_with

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")

RIG = [
    sys.executable,
    "-c",
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a shell's background job ignores it
    "from rig.cli import main; main()",
]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("replayed") / "run.h5"
    recorded_at(path, plan_with(levels_v=(0.4, 0.8)))
    return path


def environment():
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, "TERM": "xterm", "COLUMNS": "100", "LINES": "30"}


class Terminal:
    """A pseudo-terminal in which a command runs; keeps what it shows."""

    def __init__(self, *arguments):
        import pty

        self.leader, follower = pty.openpty()
        self.child = subprocess.Popen(
            [*RIG, *arguments],
            stdin=follower,
            stdout=follower,
            stderr=follower,
            env=environment(),
            start_new_session=True,
        )
        os.close(follower)
        self.text = ""

    def until(self, pattern, longest_s=60.0):
        """Read until something is shown that was not there before; return the match."""
        self.text, until_s = "", time.monotonic() + longest_s
        while not (found := re.search(pattern, self.text)):
            assert time.monotonic() < until_s, self.text[-2000:]
            if select.select([self.leader], [], [], 0.1)[0]:
                self.text += os.read(self.leader, 65536).decode(errors="replace")
        return found

    def press(self, keys):
        os.write(self.leader, keys.encode())

    def close(self):
        self.child.kill()
        self.child.wait()
        os.close(self.leader)


@pytest.fixture
def terminal(recording):
    shown = Terminal("replay", str(recording), "--terminal")
    yield shown
    shown.close()


def test_space_pauses_arrows_jump_and_q_ends(terminal):
    at = r"REPLAY +([\d.]+) of ([\d.]+) s"
    first = terminal.until(at)
    whole = float(first[2])
    terminal.press(" ")
    terminal.until("PAUSED")
    held = float(terminal.until(at)[1])
    assert float(terminal.until(at)[1]) == held
    terminal.press("\x1b[C")
    later = float(terminal.until(rf"REPLAY +(?!{held:.1f} )([\d.]+) of")[1])
    assert later == pytest.approx(held + whole / 20.0, abs=0.11)
    terminal.press("\x1b[D")
    back = float(terminal.until(rf"REPLAY +(?!{later:.1f} )([\d.]+) of")[1])
    assert back == pytest.approx(held, abs=0.11)
    terminal.press(" ")
    terminal.until("at 1 times the clock")
    terminal.press("q")
    terminal.until(re.escape("\x1b[?1049l"))
    assert terminal.child.wait(60) == 0


def test_ctrl_c_ends_a_replay_and_gives_the_terminal_back(terminal):
    import termios

    terminal.until("REPLAY")
    terminal.child.send_signal(2)
    terminal.until("replayed no further")
    assert terminal.child.wait(60) == 0
    assert termios.tcgetattr(terminal.leader)[3] & termios.ICANON


def test_in_a_pipe_it_prints_every_point_and_ends_with_the_recording(recording):
    done = subprocess.run(
        [*RIG, "replay", str(recording), "--terminal", "--speed", "1000"],
        capture_output=True,
        text=True,
        env=environment(),
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert [line.split()[1] for line in lines if line.startswith("point ")] == ["1", "2"]
    assert any(line.startswith("end: the plan was carried out") for line in lines)


def test_a_speed_or_file_that_cannot_be_is_one_line(command, recording, tmp_path):
    for arguments, text in [
        ((str(recording), "--speed", "0"), "rig: --speed = 0; allowed: above 0, up to 1000\n"),
        ((str(tmp_path / "none.h5"),), "none.h5"),
    ]:
        status, out, err = command("replay", *arguments, "--terminal")
        assert (status, out) == (1, "")
        assert text in err
        assert err.count("\n") == 1
