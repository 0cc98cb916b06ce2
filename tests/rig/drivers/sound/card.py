"""A sound card without a clock: stands in for the package ``sounddevice``, and calls the driver's code as PortAudio does.

Time goes on when the driver sleeps: a period of the card each time. What the card puts out comes back in its inputs, late.
"""

import ctypes
from types import SimpleNamespace

import numpy as np

RATE_HZ = 48000.0
CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_ulong,
    ctypes.c_void_p,
    ctypes.c_ulong,
    ctypes.c_void_p,
)
OVERFLOW, UNDERFLOW = 2, 4


class PortAudioError(Exception):
    """As of sounddevice: a text and a number."""


class Card:
    """The card, as the package sees it. Each input is the output times its gain, ``delay`` frames later."""

    PortAudioError = PortAudioError

    def __init__(self, gains=(0.5, 0.25, -1.0), delay=256, name="box", rates=(44100.0, 48000.0), outputs=2):
        self.gains, self.delay, self.rates = np.array(gains), delay, rates
        self.devices = [(name, 0, len(gains), outputs)]
        self.hosts = ["ALSA", "JACK Audio Connection Kit"]
        self.put_out = np.zeros((0, outputs))
        self.now_s = 0.0
        self.adc_s = 10.0
        self.fault = ""
        self.slow = 1.0
        self.lateness_s = 0.0
        self.promised_s = 0.0
        self.stamps = delay / RATE_HZ
        self.drive = None
        self.stream = None
        self._status = 0
        self._initialized = 1

    # What the package has

    def _terminate(self):
        assert self.stream is None or not self.stream.active, "PortAudio is let go with a stream that runs"
        self._initialized -= 1

    def _initialize(self):
        self._initialized += 1

    def query_hostapis(self):
        return [{"name": name} for name in self.hosts]

    def query_devices(self):
        return [
            {
                "index": index,
                "name": name,
                "hostapi": host,
                "max_input_channels": inputs,
                "max_output_channels": outputs,
                "default_samplerate": self.rates[-1],
                "default_low_input_latency": self.promised_s / 2,
                "default_low_output_latency": self.promised_s / 2,
            }
            for index, (name, host, inputs, outputs) in enumerate(self.devices)
        ]

    def check_input_settings(self, _device, channels, _dtype, samplerate):
        if samplerate not in self.rates or channels > len(self.gains):
            raise PortAudioError("Invalid sample rate", -9997)

    check_output_settings = check_input_settings

    def _StreamBase(self, kind, **given):  # noqa: N802 (the package's name)
        assert self._initialized == 1
        if self.fault == "in use":
            raise PortAudioError("Device unavailable", -9985)
        assert kind == "duplex"
        self.given = given
        self.callback = CALLBACK(_number(given["callback"]))
        self.memory = _number(given["userdata"])
        self.put_out = np.zeros((0, given["channels"][1]))
        self.stream = SimpleNamespace(start=lambda: None, close=self._close, active=True)
        return self.stream

    def _close(self):
        self.stream.active = False

    # What happens on it

    def monotonic(self):
        """The clock of the driver's stream."""
        return self.now_s

    def sleep(self, _seconds):
        """A period goes by, and with it the time that the host sleeps."""
        self.period()

    def period(self):
        """Exchange a period with the driver, unless the card is gone or silent."""
        frames = self.given["blocksize"]
        self.now_s += frames / RATE_HZ * self.slow
        if self.fault == "unplugged":
            self.stream.active = False
        if self.fault or not self.stream.active:
            return
        read = np.zeros((frames, self.given["channels"][0]), np.float32)
        sent = np.concatenate((np.zeros((self.delay, 1)), self.put_out[:, self.output : self.output + 1]))
        first = self.put_out.shape[0]
        here = sent[first : first + frames, 0]
        read[: here.size] = self.readings(here)[:, : read.shape[1]]
        written = np.full((frames, self.given["channels"][1]), np.nan, np.float32)
        times = np.array([self.adc_s, self.adc_s, self.adc_s + self.stamps]) + self.lateness_s
        self.lateness_s = max(0.0, self.lateness_s - 0.5 * frames / RATE_HZ)
        self.callback(read.ctypes.data, written.ctypes.data, frames, times.ctypes.data, self._status, self.memory)
        self._status = 0
        self.adc_s += frames / RATE_HZ
        self.put_out = np.concatenate((self.put_out, written))

    def readings(self, sent):
        """What the inputs read [n, inputs] of outputs [n] that have arrived, in full scales."""
        return sent[:, None] * self.gains

    def lose(self, periods):
        """The audio system does not call for some periods; the output is 0 V meanwhile."""
        frames = periods * self.given["blocksize"]
        self.now_s += frames / RATE_HZ
        self.adc_s += frames / RATE_HZ
        self.put_out = np.concatenate((self.put_out, np.zeros((frames, self.put_out.shape[1]))))
        self._status = OVERFLOW | UNDERFLOW

    def be_late(self, seconds):
        """The audio system calls late, by its time stamps too, loses nothing and catches up; it calls that an interruption."""
        self.lateness_s = seconds
        self._status = OVERFLOW | UNDERFLOW

    @property
    def output(self):
        """Column that is driven."""
        return self.given["channels"][1] - 1


def _number(pointer):
    import cffi

    return int(cffi.FFI().cast("uintptr_t", pointer))
