"""An emulated sound card: a virtual rig as a client of a JACK server, where the driver ``sound`` finds it through PortAudio.

The server is real (Debian's ``jackd2``), its back end is a clock without hardware. A server that is running already is used as
it is; otherwise one is started, and ended with the emulator. It waits for its clients (``-S``): a rig that is left out for a
period would see a step that no cable makes. Card and driver are in one graph of JACK: an output comes back in the inputs two
periods later. Audio inputs and outputs pass no direct voltage: high-passes are emulated on request, first order, at the card's
rate, behind the converters.
"""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from rig.bench import Arming, Bench, DriverChoice
from rig.bench.channels import Channel
from rig.emulator.plant import OutputLog, VirtualPlant, Wiring
from rig.errors import ConfigurationError, DaqError, DaqRefused
from vibrolock.arrays import Float

if TYPE_CHECKING:
    from rig.bench.configuration import Table
    from rig.emulator.settings import EmulatorSettings

NAME = "structure"
"""Name under which the card appears among the sound devices."""
RATE_HZ, PERIOD = 48000, 128
"""Sample rate, Hz, and frames of a period of a server that is started here."""
SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of <sys/prctl.h>."""
START_S = 15.0
"""Longest wait for a server to answer, and to end, s."""
ENDING, BETWEEN_STARTS_S = "server already active", 0.2
"""Said by a server while another one has its name, as one does that was killed a moment ago and is not gone yet, or that is too
busy to answer; and the time to the next attempt, s."""
DECIMATION = 4
"""Frames of the card in a sample of the bench that reaches it: 12 kHz of 48 kHz."""
LOOPBACK = Channel(name="loopback", role="monitor", unit="V", sensitivity_v_per_unit=1.0, range_v=10.0, loopback=True)
"""Channel that the output is connected to."""


class HighPasses:
    """A first-order high-pass for each column, by the bilinear transform; one with a corner of 0 Hz passes everything."""

    def __init__(self, corners_hz: Sequence[float], rate_hz: float) -> None:
        self._filters = {
            column: scipy.signal.butter(1, corner, "high", fs=rate_hz)
            for column, corner in enumerate(corners_hz)
            if corner
        }
        self._states = np.zeros((len(corners_hz), 1))

    def __call__(self, signals: Float) -> None:
        """Filter the next samples [n, n_columns] in place."""
        for column, (b, a) in self._filters.items():
            signals[:, column], self._states[column] = scipy.signal.lfilter(
                b, a, signals[:, column], zi=self._states[column]
            )


class Card:
    """A virtual rig between the ports of a JACK client; ports are numbered as the bench's channels, the loopback last.

    It computes a period when the server asks for it. A reading is in full scales of its input. For the time that the server
    has lost the rig vibrates on at 0 V, as a real one would. ``high_pass_hz``: corners of the output and of each input, one for
    all, or none. With ``cables`` the rig is disconnected, and every input reads the output.

    Raises `ConfigurationError` for another number of corners.
    """

    def __init__(
        self, client: Any, plant: VirtualPlant, high_pass_hz: Sequence[float] = (), cables: bool = False
    ) -> None:
        ends = 1 + len(plant.names)
        if len(high_pass_hz) not in (0, 1, ends):
            raise ConfigurationError(
                field="high_pass_hz",
                value=list(high_pass_hz),
                allowed=f"one corner, or {ends}: of the output, {', '.join(plant.names)}",
            )
        corners_hz = high_pass_hz if len(high_pass_hz) == ends else [*(high_pass_hz or [0.0])] * ends
        self._of_output = HighPasses(corners_hz[:1], client.samplerate)
        self._of_inputs = HighPasses(corners_hz[1:], client.samplerate)
        self._cables = cables
        self.counts = {"periods": 0, "interruptions": 0, "overloads": 0}
        self.failure: Exception | None = None
        self._client, self._plant = client, plant
        self._drive = client.inports.register("output_1")
        self._sensors = [
            client.outports.register(f"input_{index + 1}_{name}") for index, name in enumerate(plant.names)
        ]
        self._per_count = plant.v_per_count / plant.range_v
        client.set_process_callback(self._period)
        client.set_xrun_callback(self._interrupted)
        client.set_shutdown_callback(self._server_ended)

    def _period(self, frames: int) -> None:
        try:
            readings, flags = self._read(self._plant.output_range_v * np.array(self._drive.get_array(), float))
            for port, reading in zip(self._sensors, readings.T, strict=True):
                port.get_array()[:] = reading
            self.counts["periods"] += 1
            self.counts["overloads"] += bool(flags)
        except Exception as error:
            self.failure = error
            for port in self._sensors:
                port.get_array()[:] = 0.0

    def _read(self, volts: Float) -> tuple[Float, int]:
        """Put out voltages [n]; return the readings [n, n_channels] in full scales and the rig's flags."""
        self._of_output(volts[:, None])
        counts, flags = self._plant.step(volts)
        readings = counts * self._per_count
        if self._cables:
            readings[:], flags = readings[:, -1:], 0
        self._of_inputs(readings)
        return readings, flags

    def _server_ended(self, _status: object, reason: str) -> None:
        self.failure = DaqError(f"the JACK server has ended ({reason})")

    def _interrupted(self, _delayed_us: float) -> None:
        self.counts["interruptions"] += 1


def reaching_bench(bench: Bench, options: "Table") -> Bench:
    """Return the bench that reaches the card of a virtual bench: decimated, with the card's channels and these options.

    It arms itself: the driver cannot see that nothing physical moves behind this card.
    """
    block = max(1, round(int(str(options["period_frames"])) / DECIMATION))
    changes = {
        "driver": DriverChoice(name="sound", options=options),
        "sample_rate_hz": float(str(options["device_rate_hz"])) / DECIMATION,
        "block": block,
        "arming": Arming(automated=True, require_check=False, hardware_emergency_stop=True),
    }
    return card_bench(bench, 0.0).model_copy(update=changes)


def card_bench(bench: Bench, rate_hz: float) -> Bench:
    """Return the virtual bench of the card: at its rate, with a loopback channel behind the sensors'."""
    channels = bench.channels
    if not any(channel.loopback for channel in channels):
        channels = (*channels, LOOPBACK)
    return bench.model_copy(update={"sample_rate_hz": rate_hz, "channels": channels})


def run_sound_card(
    settings: "EmulatorSettings", when_ready: Callable[["Table"], None], should_end: Callable[[], bool]
) -> dict[str, int]:
    """Emulate a sound card until ``should_end``; return what it has counted.

    ``when_ready`` is called once it can be found, with the driver options that reach it.
    Raises `ConfigurationError`, `DaqRefused` where a package or program is missing, `DaqError` where the server has ended.
    """
    with jack_client() as client:
        bench = card_bench(settings.bench, float(client.samplerate))
        names = tuple(channel.name for channel in bench.channels)
        plant = VirtualPlant(bench, settings.seed, Wiring(names, settings.flip, settings.dead, settings.swap))
        if settings.log_output is not None:
            plant.log = OutputLog(settings.log_output)
        card = Card(client, plant, settings.high_pass_hz, settings.cables)
        with client:
            options: Table = {
                "device": NAME,
                "host_api": "JACK",
                "output_full_scale_v": plant.output_range_v,
                "input_full_scale_v": plant.range_v.tolist(),
                "device_rate_hz": float(client.samplerate),
                "period_frames": client.blocksize,
            }
            when_ready(options)
            while not should_end():
                time.sleep(0.1)
                if card.failure is not None:
                    raise DaqError(f"the emulated card has failed: {card.failure}") from card.failure
    return card.counts


@contextmanager
def jack_client() -> Iterator[Any]:
    """A client of the JACK server that is running, or of one that is started for it, not yet active."""
    try:
        import jack
    except ImportError:
        raise DaqRefused("the package JACK-Client is not installed (pip install 'vibrolock[sound]')") from None
    except OSError:
        raise DaqRefused("JACK is not installed; on Debian: apt install jackd2") from None
    with _server(jack):
        try:
            client = jack.Client(NAME, no_start_server=True, use_exact_name=True)
        except jack.JackOpenError:
            raise ConfigurationError(
                f"a client called {NAME!r} is in the JACK server already; end the other emulator"
            ) from None
        try:
            yield client
        finally:
            client.close()


@contextmanager
def _server(jack: Any) -> Iterator[None]:
    """A running JACK server; one that was started here ends here."""
    jack.set_error_function(lambda _: None)
    jack.set_info_function(lambda _: None)
    if _answers(jack):
        yield
        return
    program = shutil.which("jackd")
    if program is None:
        raise DaqRefused("the program jackd is not installed; on Debian: apt install jackd2")
    command = [program, *_scheduling(), "-S", "-d", "dummy", "-r", str(RATE_HZ), "-p", str(PERIOD)]
    until = time.monotonic() + START_S
    while True:
        with _running(command) as (server, last_lines):
            if _answers_before(jack, server, until):
                yield
                return
        said = "; ".join(line.strip() for line in last_lines)
        if time.monotonic() > until:
            raise DaqError(f"{' '.join(command)}: the server has not begun to answer within {START_S:g} s: {said}")
        if ENDING not in said:
            raise DaqError(f"{' '.join(command)}: the server has ended: {said}")
        time.sleep(BETWEEN_STARTS_S)


@contextmanager
def _running(command: list[str]) -> Iterator[tuple["subprocess.Popen[str]", deque[str]]]:
    """A process while the context lasts, and what it has written last; after the context nothing more comes."""
    last_lines: deque[str] = deque(maxlen=3)
    server = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
        preexec_fn=_end_with_parent if sys.platform == "linux" else None,
    )
    assert server.stderr is not None
    reading = threading.Thread(target=last_lines.extend, args=(server.stderr,), daemon=True)
    reading.start()
    try:
        yield server, last_lines
    finally:
        server.send_signal(signal.SIGTERM)
        try:
            server.wait(START_S)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()
        reading.join(START_S)


def _answers_before(jack: Any, server: "subprocess.Popen[str]", until: float) -> bool:
    """Wait until a server answers; false once this one has ended, or at a time of the monotonic clock."""
    while not _answers(jack):
        if server.poll() is not None or time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def _end_with_parent() -> None:
    """Let the server end when this process is killed."""
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)


def _scheduling() -> list[str]:
    """Options of the server: real-time scheduling where this process may ask for it."""
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, *before)
    except (AttributeError, OSError):
        return ["-r"]
    return ["-R", "-P", "70"]


def _answers(jack: Any) -> bool:
    try:
        jack.Client("rig", no_start_server=True).close()
    except jack.JackOpenError:
        return False
    return True
