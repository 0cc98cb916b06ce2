"""The delay of a stream from output to input, measured through a loopback cable."""

import math
from typing import NamedTuple

import numpy as np

from rig.drivers.sound.stream import DuplexStream
from rig.errors import DaqError, DaqOverrun
from vibrolock.arrays import Float

BAND = (0.02, 0.1)
"""Band of the signal, of the device's rate: 1 to 5 kHz of 48, above what is tested and below where converters' filters bend the
phase. Chosen."""
LENGTH = 4096
"""Frames of one period of the signal."""
LONGEST = 3
"""Periods within which the signal must have come back; longer delays are no use to a loop."""
ATTEMPTS = 10
"""Attempts to measure on a busy machine; chosen: three seconds."""
LEAST_COHERENCE = 0.99
"""Share of the signal's energy that a pure delay must explain; below it, the cable or the channel is another's."""


FRAMES = (LONGEST + 1) * LENGTH
"""Frames that the measurement takes, at least."""


class Loopback(NamedTuple):
    """What comes back of the output."""

    delay: float
    """Delay, frames."""
    gain: float
    """Reading over output, in full scales; negative where the polarity is reversed."""
    coherence: float
    """Share of the energy that delay and gain explain."""


def signal_of(length: int = LENGTH) -> Float:
    """Return one period [length] of a multisine in `BAND` with a peak of 1; its phases are Schroeder's (1970)."""
    lines = np.arange(math.ceil(BAND[0] * length), math.floor(BAND[1] * length))
    spectrum = np.zeros(length // 2 + 1, complex)
    order = np.arange(lines.size)
    spectrum[lines] = np.exp(-1j * np.pi * order * (order - 1) / lines.size)
    period = np.fft.irfft(spectrum, length)
    return np.asarray(period / np.abs(period).max())


def delay_of(sent: Float, read: Float) -> Loopback:
    """Return the delay of one reading [n] behind what was sent, one period [m <= n]; the signal comes once, then nothing.

    The whole frames come from the cross-correlation, the rest from the slope of the cross-spectrum's phase (least squares,
    weighted by its size).
    """
    size = 2 * read.size
    at = np.fft.rfftfreq(size)
    within = (at > BAND[0]) & (at < BAND[1])
    output, cross = np.fft.rfft(sent, size), np.fft.rfft(read, size)
    cross = cross * output.conj()
    correlation = np.fft.irfft(cross, size)[: read.size]
    whole = int(np.argmax(np.abs(correlation)))
    sign = math.copysign(1.0, correlation[whole])
    turned = sign * cross[within] * np.exp(2j * np.pi * at[within] * whole)
    weight = np.abs(turned)
    if not weight.any():
        return Loopback(0.0, 0.0, 0.0)
    rest = -float(weight @ (np.angle(turned) * at[within]) / (weight @ at[within] ** 2)) / (2.0 * np.pi)
    delay = whole + rest
    straight = np.exp(-2j * np.pi * at[within] * delay)
    energy = np.abs(output[within]) ** 2
    gain = float(np.real(np.sum(cross[within] * straight.conj())) / np.sum(energy))
    total = float(np.sum(np.abs(np.fft.rfft(read, size)[within]) ** 2))
    return Loopback(delay, gain, gain**2 * float(np.sum(energy)) / total if total else 0.0)


def measured_delay(stream: DuplexStream, column: int, amplitude: int, channel: str) -> float:
    """Put out one period of the signal with a peak of ``amplitude`` counts, and return its delay to a column, frames.

    It is repeated where the audio system has lost frames. Raises `DaqOverrun` where it loses some every time, `DaqError` where
    the signal does not come back.
    """
    for _ in range(ATTEMPTS):
        heard = _heard(stream, column, amplitude)
        if heard is not None and heard.coherence >= LEAST_COHERENCE:
            return heard.delay
    if heard is None:
        raise DaqOverrun(
            f"the delay of the stream cannot be measured: the audio system has lost frames in each of {ATTEMPTS} attempts "
            "(driver.options.period_frames)"
        )
    raise DaqError(
        f"the output does not come back on the loopback channel {channel!r}: {100.0 * heard.coherence:.0f} % of what it "
        "reads is the output; check the cable, its input and driver.options.output"
    )


def _heard(stream: DuplexStream, column: int, amplitude: int) -> Loopback | None:
    """Put out the signal once; return what comes back of it, None where frames were lost."""
    counts = np.zeros(FRAMES, np.int64)
    counts[:LENGTH] = np.rint(amplitude * signal_of())
    stream.begin()
    lead = 4 * stream.period
    stream.put(lead, counts)
    read = stream.take(FRAMES).inputs[:, column]
    stream.begin()  # nothing is to come that its watchdog could miss
    if not np.all(np.isfinite(read)):
        return None
    heard = delay_of(counts[:LENGTH].astype(float), read)
    return heard._replace(delay=heard.delay - lead)
