"""The emulated sound card: a real JACK server, PortAudio, and a virtual rig as its client; by the clock."""

import os
import shutil
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from rig.daq import LOST
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.emulator.emulated import emulated
from rig.emulator.sound import RATE_HZ, card_bench
from rig.errors import DaqDisconnected, DaqTimeout
from tests.rig.rigs import bench_with

PERIODS = 2
"""Of the graph: the output of one period is in the inputs of the second one after it."""


def _missing():
    if not shutil.which("jackd"):
        return "no jackd (Debian: jackd2)"
    try:
        import jack  # noqa: F401
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        return f"the audio packages are not there: {error}"
    return ""


@pytest.fixture(autouse=True)
def server(monkeypatch):
    """A server of this test alone; without JACK the test skips, or fails where it must be there."""
    missing = _missing()
    if missing and os.environ.get("VIBROLOCK_SOUND") == "required":
        pytest.fail(missing)
    if missing:
        pytest.skip(missing)
    monkeypatch.setenv("JACK_DEFAULT_SERVER", f"vibrolock-{os.getpid()}")
    monkeypatch.setenv("JACK_NO_START_SERVER", "1")
    monkeypatch.setenv("JACK_NO_AUDIO_RESERVATION", "1")


def _server():
    """The process of this test's server."""
    mine = f"JACK_DEFAULT_SERVER={os.environ['JACK_DEFAULT_SERVER']}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if (process / "comm").read_text().strip() == "jackd" and mine in (process / "environ").read_bytes():
                return int(process.name)
    raise AssertionError("no server")


def _exchange_zeros(daq, blocks):
    for _ in range(blocks):
        daq.exchange(np.zeros(daq.block))


@pytest.fixture
def card():
    with emulated(bench_with(), "sound", lockstep=False, options={"queue_blocks": 4, "watchdog_s": 1.0}) as bench:
        yield bench


def test_the_latency_is_that_of_the_graph_and_of_the_cards_converters(card):
    rig = VirtualDAQ(card_bench(bench_with(), float(RATE_HZ))).rig
    with make_daq(card) as daq:
        daq.start(card.block)
        filters = daq.queue_samples - 4 * card.block
        frames = (daq.latency_samples - 4 * card.block - 2 * filters) * RATE_HZ / card.sample_rate_hz
        assert frames == pytest.approx(PERIODS * 128 + 0.5 + rig.filter_delay_samples, abs=0.1)
        assert daq.identity["latency_from"] == "loopback channel loopback"


def test_what_is_put_out_comes_back_through_server_and_rig(card):
    with make_daq(card) as daq:
        daq.start(card.block)
        rows, lost = [], []
        for number in range(300):
            instants = np.arange(number * card.block, (number + 1) * card.block)
            daq.continuation[0] = card.sample_rate_hz / 100.0, 0.0
            rows.append(daq.exchange(np.sin(2.0 * np.pi * 100.0 * instants / card.sample_rate_hz)))
            lost.append(daq.flags.copy())
        read, flags = np.concatenate(rows)[:, -1], np.concatenate(lost)
        good = (flags != LOST) & (np.arange(read.size) > 0.05 * card.sample_rate_hz)
        late = np.arange(read.size) - daq.latency_samples
        expected = np.sin(2.0 * np.pi * 100.0 * late / card.sample_rate_hz)
        # where the server has left out the card, the cable is silent: most samples are right, whatever else the machine does
        assert np.median(np.abs(read[good] - expected[good])) < 1e-3
        daq.exchange_zeros()


def test_a_server_that_ends_is_a_device_that_is_gone(card):
    with make_daq(card) as daq:
        daq.start(card.block)
        daq.exchange(np.zeros(card.block))
        os.kill(_server(), signal.SIGKILL)
        with pytest.raises((DaqDisconnected, DaqTimeout)):
            _exchange_zeros(daq, 2000)
