"""`rig calibrate` with a person at the terminal, who is asked for the reading of a multimeter."""

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from rig.bench import load_bench
from tests.rig.calibration.test_calibrate import BENCH, FULL_SCALE_V

fcntl, pty, termios = (pytest.importorskip(name) for name in ("fcntl", "pty", "termios"))


CABLES = """
import rig.cli
from tests.rig.calibration.test_calibrate import Cables, session

session.make_daq = Cables
rig.cli.main()
"""
"""A process of the command with cables as its device."""
PATIENCE_S = 300.0
"""Time after which a command that waits for ever is ended, s."""


def at_a_terminal(typed, folder):
    """What the command says and its status with a person at the terminal, who types this when asked for the reading."""
    ours, theirs = pty.openpty()
    line = [sys.executable, "-c", CABLES, "calibrate", "bench.toml", "-o", "calibrated.toml", "--seconds", "4"]
    path = {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[3]), *sys.path])}
    process = subprocess.Popen(
        line,
        cwd=folder,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=os.environ | path,
        start_new_session=True,
        preexec_fn=_take_terminal,
    )
    os.close(theirs)
    patience = threading.Timer(PATIENCE_S, process.kill)
    patience.start()
    said = b""
    with suppress(OSError):  # the terminal is closed by its last process
        while part := os.read(ours, 4096):
            said += part
            if typed and said.rstrip().endswith(b"(Enter for none):"):
                os.write(ours, typed.pop(0))
                said += b" "
    os.close(ours)
    status = process.wait()
    patience.cancel()
    return said.decode(), status


def _take_terminal():
    """So that Ctrl-C is a signal, also where the tests run in the background, in which it is ignored."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
def test_a_person_at_the_terminal_is_asked_for_the_reading(tmp_path):
    options = f"options = {{ output_full_scale_v = {FULL_SCALE_V}, input_full_scale_v = {FULL_SCALE_V} }}"
    (tmp_path / "bench.toml").write_text(BENCH.replace('name = "cables"\n\n[l', f'name = "cables"\n{options}\n\n[l'))
    said, status = at_a_terminal([b"a lot\n", b"0.5\n"], tmp_path)
    assert status == 0, said
    assert said.index("read a true RMS multimeter") < said.index("reading of the multimeter")
    assert "allowed is a number above 0" in said
    assert load_bench(tmp_path / "calibrated.toml").driver.options["output_full_scale_v"] == pytest.approx(
        0.5 / 0.408 * FULL_SCALE_V, rel=0.01
    )


@pytest.mark.slow
def test_ctrl_c_at_the_question_writes_nothing_and_says_one_line(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH)
    said, status = at_a_terminal([b"\x03"], tmp_path)
    assert status == 130
    assert not (tmp_path / "calibrated.toml").exists()
    assert said.rpartition("(Enter for none):")[2].replace("^C", "").strip() == "rig: interrupted"
