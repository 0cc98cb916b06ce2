"""The commands of the page of sound cards, as printed, with the emulated card."""

import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

from rig.bench import load_bench
from tests.docs.pages import ROOT, blocks, rig_commands
from tests.sound_server import own_sound_server
from tests.waiting import LONG_S

BUSY = ("lost frames in each", "the watchdog has brought", "did not take its rows")
"""Said where this machine is too busy for an audio server."""


def started(words):
    command = [sys.executable, "-c", "from rig.cli import main; main()", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def interrupted_after_a_point(words):
    """Run a plan and press Ctrl-C once a point is reported; the test skips where the machine is too busy for any."""
    with started(words) as run:
        lines = []
        for line in run.stderr:
            lines.append(line)
            if line.startswith("point"):
                run.send_signal(signal.SIGINT)
                break
        out, err = run.communicate(timeout=LONG_S)
    said = "".join(lines) + err + out
    if any(text in said for text in BUSY):
        pytest.skip(said)
    assert run.returncode == 1, said
    return said


def _end(process):
    process.send_signal(signal.SIGINT)
    return process.communicate(timeout=LONG_S)


@contextmanager
def emulated_card(words):
    """The emulated card while the context lasts; it ends as after Ctrl-C."""
    with started(words) as card:
        try:
            assert "device structure" in card.stdout.readline(), card.stderr.read()
            yield
        except BaseException as error:
            error.add_note(f"the card: {_end(card)}")
            raise
        out, err = _end(card)
    assert card.returncode == 0, err
    assert out.startswith("ended: ")


def commands(note):
    """Commands of each block of the page with a note."""
    page = blocks(ROOT / "docs" / "how-to" / "use-a-sound-card.md")
    return [rig_commands(block) for block in page if block.language == "bash" and block.not_run == note]


def ended(words):
    with started(words) as process:
        out, err = process.communicate(timeout=LONG_S)
    if process.returncode and any(text in err for text in BUSY):
        pytest.skip(err)
    assert process.returncode == 0, err
    return out


@pytest.fixture
def server(monkeypatch):
    with own_sound_server(monkeypatch):
        yield


@pytest.mark.slow
def test_the_commands_of_the_page_lead_from_the_devices_to_a_figure_and_to_a_calibration(server, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))  # no trip of another run
    monkeypatch.chdir(tmp_path)
    (emulate,), (emulate_cables,) = commands("runs until Ctrl-C")
    (listing, run, plot), (calibrate,) = commands("needs the emulated card")
    with emulated_card(emulate):
        assert "5 inputs, 1 outputs, 48000 Hz" in ended(listing)
        assert "of 13 points accepted" in interrupted_after_a_point(run)
        ended(plot)
    assert (tmp_path / "backbone.png").read_bytes().startswith(b"\x89PNG")
    with emulated_card(emulate_cables):
        ended(calibrate)
    found = load_bench(str(tmp_path / "calibrated.toml")).driver.options
    assert found["output_high_pass_hz"] == pytest.approx(5.0, abs=0.5)
