"""The emulated sound card: a real JACK server, PortAudio, and a virtual rig as its client; by the clock."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import tomli_w

from rig.conformance.run import OUTCOMES
from rig.conformance.without_host import KILLING_TEST
from rig.drivers.virtual import VirtualDAQ
from rig.emulator.emulated import Emulator, emulated
from rig.emulator.sound import RATE_HZ, card_bench
from rig.errors import DaqError
from tests.rig.rigs import bench_with
from tests.sound_server import own_sound_server, servers

PERIODS = 2
"""Of the graph: the output of one period is in the inputs of the second one after it."""
BUSY = ("lost frames in each", "samples were lost")
"""Said where this machine is too busy for an audio server."""


@pytest.fixture
def server(monkeypatch):
    with own_sound_server(monkeypatch):
        yield


def _card(**settings):
    """A card, and a bench that reaches it."""
    return emulated(bench_with(), "sound", lockstep=False, options={"queue_blocks": 4, "watchdog_s": 1.0}, **settings)


@pytest.fixture
def card(server):
    """A bench that reaches a card on a server of this test."""
    with _card() as bench:
        yield bench


@pytest.fixture(scope="module")
def lasting_card():
    """Such a bench for tests that leave server and card as they are."""
    with pytest.MonkeyPatch.context() as patched, own_sound_server(patched), _card() as bench:
        yield bench


def _host(bench, what):
    host = subprocess.Popen(
        [sys.executable, "-m", "tests.rig.emulator.sound_host", what],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    host.stdin.write(bench.model_dump_json() + "\n")
    host.stdin.flush()
    return host


def _said(bench, what):
    """What a host has found; the test skips where the machine is too busy for any audio."""
    out, _ = _host(bench, what).communicate(timeout=180)
    said = json.loads(out.splitlines()[-1])
    if any(busy in said.get("text", "") for busy in BUSY) or said.get("error") == "DaqWatchdog":
        pytest.skip(said["text"])
    return said


def _server():
    """The process of this test's server."""
    (server,) = servers(os.environ["JACK_DEFAULT_SERVER"])
    return server


def _runs(process):
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
def test_the_latency_is_that_of_the_graph_and_of_the_cards_converters(lasting_card):
    rig = VirtualDAQ(card_bench(bench_with(), float(RATE_HZ))).rig
    said = _said(lasting_card, "latency")
    assert said["from"] == "loopback channel loopback"
    assert said["frames"] == pytest.approx(PERIODS * 128 + 0.5 + rig.filter_delay_samples, abs=0.1)


def test_what_is_put_out_comes_back_through_server_and_rig(lasting_card):
    # where the server has left out the card, the cable is silent: most samples are right, whatever else the machine does
    assert _said(lasting_card, "sine")["median_v"] < 1e-3


def test_a_server_that_does_not_start_says_why(server, monkeypatch, tmp_path):
    program = tmp_path / "jackd"
    program.write_text("#!/bin/sh\necho Too many servers already active >&2\nexit 255\n")
    program.chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(DaqError, match="the server has ended: Too many servers already active"):
        Emulator(bench_with(), "sound", lockstep=False).start()


def test_a_server_whose_name_another_one_still_has_is_started_again(server, monkeypatch, tmp_path):
    program, first = tmp_path / "jackd", tmp_path / "first"
    first.touch()
    real = shutil.which("jackd")
    already = f"rm {first}; echo 'x server already active' >&2; echo Failed to open server >&2; exit 255"
    program.write_text(f'#!/bin/sh\nif [ -e {first} ]; then {already}; fi\nexec {real} "$@"\n')
    program.chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with Emulator(bench_with(), "sound", lockstep=False):
        assert not first.exists()


def test_the_server_ends_with_a_card_that_is_killed(server):
    with Emulator(bench_with(), "sound", lockstep=False) as card:
        jackd = _server()
        card.process.kill()
        until = time.monotonic() + 30.0
        while _runs(jackd):
            assert time.monotonic() < until
            time.sleep(0.05)


@pytest.mark.slow
def test_a_server_that_ends_is_a_device_that_is_gone(card):
    host = _host(card, "zeros")
    first = host.stdout.readline()
    if any(busy in first for busy in BUSY):
        pytest.skip(first)
    assert first == "running\n"
    os.kill(_server(), signal.SIGKILL)
    out, _ = host.communicate(timeout=60)
    assert json.loads(out)["error"] in ("DaqDisconnected", "DaqTimeout")
    assert host.returncode == 0


REPEATABLE = {
    "a repeatable device repeats itself",
    "an output does not show before its latency",
    "an output shows once its latency is over",
    "every block size gives the same samples",
}
UNSEEN = {
    "a device that is gone is a daq error and can be closed",  # the test above takes the server away
    "every channel reads what is known of it",  # tests/contract/test_sound.py knows it
    "voltages up to the range are put out",  # so does that
}


@pytest.mark.slow
def test_the_driver_keeps_the_contract_over_jack(server, tmp_path):
    log, path = tmp_path / "output", tmp_path / "card.toml"
    options = {"queue_blocks": 31, "watchdog_s": 1.0}  # of a busy machine
    with emulated(bench_with(), "sound", lockstep=False, log_output=log, options=options) as bench:
        path.write_text(tomli_w.dumps(bench.model_dump(mode="json", exclude_none=True)))
        words = ["conformance", "--bench", str(path), "--arm", "--output-log", str(log), "--json"]
        program = [sys.executable, "-c", "from rig.cli import main; main()", *words]
        done = subprocess.run(program, capture_output=True, text=True, check=False)
    if "pa_jack.c" in done.stderr:  # PortAudio ends a process that a busy server has dropped
        pytest.skip(done.stderr)
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)["tests"]
    assert [one for one in found if one["outcome"] == "failed"] == []
    of = {outcome: {one["test"] for one in found if one["outcome"] == outcome} for outcome in OUTCOMES}
    assert of["not applicable"] == {*REPEATABLE, KILLING_TEST.removeprefix("test_").replace("_", " ")}
    if busy := of["unproven"] - UNSEEN:
        pytest.skip(f"this machine was too busy for: {', '.join(sorted(busy))}")
