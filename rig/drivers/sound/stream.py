"""A duplex stream of a sound device: outputs go in by blocks, inputs come out by blocks, frames are counted."""

import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from rig.drivers.sound.callback import FULL_SCALE, MESSAGES, Memory, compiled_callback, publish
from rig.drivers.sound.devices import SoundDevice, abandon, as_sound_error, library, release
from rig.errors import DaqDisconnected, DaqError, DaqOverrun, DaqTimeout, DaqWatchdog
from vibrolock.arrays import Float, Int

SHORTEST_SLEEP_S = 1e-4
"""Shortest sleep while frames are awaited, s; chosen: far below a period."""
WRONG_RATE = 0.02
"""Relative difference from the nominal rate from which on the device runs at another; chosen: clocks differ by 1e-4."""
RATE_OVER_S, RATE_TIMES = 1.0, 3
"""Time over which the rate of the device is measured, s, and how often in a row it must be wrong: on a busy computer an audio
system may be slow for a second."""


class Setting(NamedTuple):
    """What a stream is opened with."""

    device: SoundDevice
    rate_hz: float
    period: int
    """Frames that the audio system exchanges at once."""
    inputs: tuple[int, ...]
    """Channels, from 1 on, in the order in which they are returned."""
    output: int
    """Channel, from 1 on."""
    timeout_s: float
    """Longest wait for frames."""


class Frames(NamedTuple):
    """Frames that have been exchanged."""

    inputs: Float
    """Readings [n, n_channels] in full scales; NaN where frames were lost."""
    flags: Int
    """Flags [n] (`rig.drivers.sound.callback`)."""
    put_out: Int
    """Counts [n] that were put out."""


class DuplexStream:
    """A stream that runs from its making until `close`; until the first block of outputs it puts out 0 V.

    ``block``: frames of a block; ``ahead``: blocks that may wait for their time; ``longest_period``: longest period, frames, of
    a continuation; ``watchdog`` and ``fade``: frames without outputs until the output is brought down, and of that.
    """

    def __init__(
        self, setting: Setting, *, block: int, ahead: int, longest_period: int, watchdog: int, fade: int
    ) -> None:
        self._setting, self.block = setting, block
        self.period = setting.period
        self._columns = [channel - 1 for channel in setting.inputs]
        outputs, inputs = setting.output, max(setting.inputs)
        behind = max(int(2.0 * setting.rate_hz), 4 * block + 8 * setting.period)
        self.memory = Memory(
            inputs, outputs, setting.output - 1, ahead=ahead * block, behind=behind, longest_period=longest_period
        )
        self._record = self.memory.record
        self.memory.clock["rate_hz"], self._record["watchdog"] = setting.rate_hz, watchdog
        self._record["is_gapless"] = setting.device.host_api.startswith("JACK")
        self._record["fade_length"] = max(1, fade)
        self._audio = audio = library()
        self._sent = self._place = self._taken = 0
        self._is_silent = False
        try:
            self._stream = audio._StreamBase(
                "duplex",
                samplerate=setting.rate_hz,
                blocksize=setting.period,
                device=setting.device.number,
                channels=(inputs, outputs),
                dtype="float32",
                latency="low",
                callback=_function(compiled_callback().address),
                userdata=_function(self.memory.address),
                clip_off=True,
                dither_off=True,
            )
            self._stream.start()
        except (audio.PortAudioError, ValueError) as error:
            raise as_sound_error(error, setting.device.text) from error
        try:
            self._await(lambda: self._record["calls"] >= 2)
        except BaseException:
            self.close()
            raise
        self._began, self._times_wrong = (time.monotonic(), int(self._record["done"]), 0), 0

    @property
    def interruptions(self) -> int:
        """Number of times that the audio system has lost frames."""
        return int(self._record["interruptions"])

    @property
    def latency_s(self) -> float:
        """Output time less input time by the time stamps of the stream, s."""
        return float(self._record["latency_s"])

    def begin(self) -> None:
        """Count the next frame as the first one, with nothing put out yet."""
        self._record["begin"] += 1
        self._await(lambda: self._record["begun"] == self._record["begin"])
        self._taken = int(self._record["origin"])

    def put(self, first: int, counts: Int, period: int = 0, ramp: int = 0) -> None:
        """Hand over outputs [n], due from frame ``first`` on; how they go on as in `rig.continuation.keep`."""
        memory, size = self.memory, counts.size
        at = self._place % memory.sent.size
        if at + size > memory.sent.size:  # a message does not wrap
            self._place, at = self._place + memory.sent.size - at, 0
        memory.sent[at : at + size] = counts
        memory.messages[self._sent % MESSAGES] = first, size, at, period, ramp
        publish(self._record)
        self._sent += 1
        self._place += size

    def take(self, frames: int | None = None) -> Frames:
        """Wait for the next block of frames, or for so many, and return them."""
        record, block = self._record, frames or self.block
        self._await(lambda: record["done"] >= self._taken + block)
        if record["tripped"]:
            raise DaqWatchdog(
                f"{self._setting.device.text}: the watchdog has brought the output to 0 V, for no output had come in time "
                "(driver.options.watchdog_s)"
            )
        if record["done"] - self._taken > self.memory.flags.size - 2 * self._setting.period:
            raise DaqOverrun(f"{self._setting.device.text}: the inputs of 2 s have not been fetched in time")
        rows = np.arange(self._taken, self._taken + block) % self.memory.flags.size
        self._taken += block
        self._check_rate()
        return Frames(
            self.memory.inputs[rows][:, self._columns].astype(float), self.memory.flags[rows], self.memory.put_out[rows]
        )

    def _await(self, true: Callable[[], bool]) -> None:
        """Sleep until something is true.

        Raises `DaqDisconnected` or `DaqTimeout` if no frames have come for the time allowed.
        """
        seen, since = int(self._record["done"]), time.monotonic()
        looked = since
        period_s = self._setting.period / self._setting.rate_hz
        while not true():
            time.sleep(max(SHORTEST_SLEEP_S, 0.1 * period_s))
            done, now = int(self._record["done"]), time.monotonic()
            if (
                done != seen or now - looked > 0.5 * self._setting.timeout_s
            ):  # this process itself may have been stopped
                seen, since = done, now
            elif now - since > self._setting.timeout_s:
                self._is_silent = True
                device = self._setting.device.text
                if not self._is_active:
                    raise DaqDisconnected(f"{device}: the stream has ended: the device or its audio server is gone")
                raise DaqTimeout(
                    f"{device}: no frames have come for {self._setting.timeout_s:g} s; the device or its audio server is silent"
                )
            looked = now

    @property
    def _is_active(self) -> bool:
        try:
            return bool(self._stream.active)
        except self._audio.PortAudioError:
            return False

    def _check_rate(self) -> None:
        """Raise `DaqError` if another program has changed the rate of the device."""
        began, first, interruptions = self._began
        now = time.monotonic()
        if now - began < RATE_OVER_S:
            return
        done = int(self._record["done"])
        rate_hz = (done - first) / (now - began)
        self._began = now, done, self.interruptions
        nominal_hz = self._setting.rate_hz
        periods_s = 4.0 * self._setting.period / nominal_hz
        off = abs(rate_hz / nominal_hz - 1.0) - periods_s / (now - began)
        self._times_wrong = self._times_wrong + 1 if interruptions == self.interruptions and off > WRONG_RATE else 0
        if self._times_wrong == RATE_TIMES:
            raise DaqError(
                f"{self._setting.device.text}: the device runs at about {rate_hz:.4g} frames/s, not at {nominal_hz:g}; "
                "another program has changed its rate"
            )

    def close(self) -> None:
        """Fade the output to 0 V, and end the stream; also where the device is gone."""
        record = self._record
        record["stop"] = 1
        until = time.monotonic() + self._setting.timeout_s
        while (
            self._is_active
            and time.monotonic() < until
            and not 0 <= record["fade_at"] <= record["done"] - record["fade_length"] - 2 * self._setting.period
        ):
            time.sleep(SHORTEST_SLEEP_S)
        if not self._is_active or self._is_silent:
            abandon(self.memory)
            return
        with suppress(self._audio.PortAudioError):  # the device may be gone
            self._stream.close()
        release()


def _function(address: int) -> object:
    """Return an address as a pointer that PortAudio's binding takes."""
    import cffi

    return cffi.FFI().cast("void *", address)


def counts_of(volts: Float, full_scale_v: float) -> Int:
    """Return the counts [n] of voltages [n], within the range of the converter."""
    return np.clip(np.rint(volts * (FULL_SCALE / full_scale_v)), -FULL_SCALE, FULL_SCALE - 1).astype(np.int64)
