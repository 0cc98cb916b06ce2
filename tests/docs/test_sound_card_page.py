"""The commands of the page of sound cards, as printed, with the emulated card."""

import signal
import subprocess
import sys

import pytest

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


def test_the_commands_of_the_page_lead_from_the_devices_to_a_figure(monkeypatch, tmp_path):
    own_sound_server(monkeypatch)
    monkeypatch.chdir(tmp_path)
    page = [block for block in blocks(ROOT / "docs" / "how-to" / "use-a-sound-card.md") if block.language == "bash"]
    (emulate,) = [rig_commands(block)[0] for block in page if block.not_run == "runs until Ctrl-C"]
    listing, run, plot = next(rig_commands(block) for block in page if block.not_run == "needs the emulated card")
    with started(emulate) as card:
        try:
            assert "device structure" in card.stdout.readline(), card.stderr.read()
            with started(listing) as listed:
                out, _ = listed.communicate(timeout=LONG_S)
            assert "structure (JACK Audio Connection Kit): 5 inputs, 1 outputs, 48000 Hz" in out
            assert "of 13 points accepted" in interrupted_after_a_point(run)
            with started(plot) as drawn:
                _, err = drawn.communicate(timeout=LONG_S)
            assert drawn.returncode == 0, err
        finally:
            card.send_signal(signal.SIGINT)
            out, err = card.communicate(timeout=LONG_S)
    assert card.returncode == 0, err
    assert out.startswith("ended: ")
    assert (tmp_path / "backbone.png").read_bytes().startswith(b"\x89PNG")
