"""Recorded signals of an experiment: selection, order, and correction for skew, offsets and high-pass of the channels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
import scipy

from identification import Channel, Experiment
from identification.common import chosen_rows
from identification.experiments import InitialState, PeriodChange
from rig.bench import Bench
from rig.campaigns.evaluation.vibrations import VOLTAGE, channels_of

SKEW_EDGE = 32
"""Samples at either end of a record that are spoilt when a fraction of a sample of skew is removed, in addition to the skew."""
_KAISER_BETA = 8.6  # of the window: side lobes 90 dB down
_RESTORED = 10.0
"""Multiple of a sensor's corner from which on its high-pass is removed from records that are not periodic."""
_HELD_AT_ZERO = ("velocity", "acceleration")


class _Facts(TypedDict, total=False):
    """Fields of an experiment other than its signals."""

    name: str
    level: float
    initial_state: InitialState
    counted_from: int
    period_samples: int
    excited_hz: tuple[float, float]
    noise_covariance: np.ndarray | None
    period_change: PeriodChange | None


@dataclass(frozen=True)
class Signals:
    """Signals chosen from a bench. The rows are all input channels in the order of the bench, then the output ``voltage``."""

    bench: Bench
    """The bench as it was recorded."""
    inputs: tuple[int, ...]
    """Rows that are inputs of a model."""
    outputs: tuple[int, ...]
    """Rows that are outputs of a model."""

    @classmethod
    def chosen(cls, bench: Bench, inputs: Sequence[str], outputs: Sequence[str] | None) -> "Signals":
        """Choose signals by name or role; ``outputs`` None: all motions, and the force unless it is an input.

        Raises `IdentificationError` for an unknown name, for an empty choice, and for a channel that is both input and output.
        """
        channels = (*channels_of(bench), VOLTAGE)
        into, out = chosen_rows(channels, inputs, outputs)
        return cls(bench, into, out)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels, including the output ``voltage``."""
        return (*channels_of(self.bench), VOLTAGE)

    def experiment(self, values: np.ndarray, rate_hz: float, **facts: Unpack[_Facts]) -> Experiment:
        """Return an experiment with ``values``, float[n_channels + 1, n] at a rate in Hz; ``facts``: its other fields."""
        return Experiment(
            inputs=values[list(self.inputs)],
            outputs=values[list(self.outputs)],
            sample_rate_hz=rate_hz,
            input_channels=tuple(self.channels[row] for row in self.inputs),
            output_channels=tuple(self.channels[row] for row in self.outputs),
            specimen=self.bench.specimen.name,
            **facts,
        )

    def of(self, rows: np.ndarray) -> np.ndarray:
        """Return recorded rows unchanged as float[n_channels + 1, n]."""
        return np.vstack([rows["inputs"].T.astype(float), rows["output_v"].astype(float)])

    @property
    def offset(self) -> np.ndarray:
        """bool[n_channels + 1]: channels whose mean over a vibration is a sensor offset, because no motion lasts forever."""
        return np.array([c.role in ("drive", "response") and c.motion in _HELD_AT_ZERO for c in self.channels])

    @property
    def skew(self) -> np.ndarray:
        """float[n_channels + 1]: samples by which each channel lags."""
        return np.array([*(channel.skew_samples for channel in self.bench.channels), 0.0])

    def without_high_pass(self, signals: np.ndarray) -> np.ndarray:
        """Remove the high-passes of sensors and inputs above some hertz from a record that is not periodic; below, it stays.

        The exact inverse, ``1 - i f_c / f``, would integrate offsets and drift. Its second part therefore fades below
        `_RESTORED` corners: at 25 Hz and a corner of 0.3 Hz an error of 2e-4 rad is left of 0.012 rad. A second at either end
        of a record that does not begin or end at rest is not corrected in full.
        """
        corners_hz = np.array([(one.high_pass_hz, one.input_high_pass_hz) for one in self.bench.channels])
        if not corners_hz.any():
            return signals
        rate_hz, samples = self.bench.sample_rate_hz, signals.shape[1]
        padded = scipy.fft.next_fast_len(samples + int(rate_hz / corners_hz[corners_hz > 0.0].min()))
        frequency_hz = np.fft.rfftfreq(padded, 1.0 / rate_hz)
        found = signals.copy()
        for row, column in zip(*np.nonzero(corners_hz), strict=True):
            corner_hz = corners_hz[row, column]
            factor = -1j * corner_hz * frequency_hz / (frequency_hz**2 + (_RESTORED * corner_hz) ** 2)
            found[row] += scipy.fft.irfft(scipy.fft.rfft(found[row], padded) * factor, padded)[:samples]
        return np.asarray(found)

    def in_step(self, signals: np.ndarray) -> tuple[np.ndarray, int]:
        """Advance every channel by its skew; also return how many samples at either end are spoilt."""
        skew = self.skew
        if not skew.any():
            return signals, 0
        moved = np.array([_advanced(row, samples) for row, samples in zip(signals, skew, strict=True)])
        return moved, SKEW_EDGE + int(np.ceil(np.abs(skew).max()))


def _advanced(signal: np.ndarray, samples: float) -> np.ndarray:
    """Advance a signal by ``samples``: whole samples by shifting, the rest by a windowed sinc; zero beyond its ends."""
    if samples == 0.0:
        return signal
    whole = int(np.round(samples))
    at = np.arange(-SKEW_EDGE, SKEW_EDGE + 1)
    window = np.kaiser(at.size, _KAISER_BETA)
    kernel = np.sinc(at + (samples - whole)) * window
    padded = np.pad(signal, SKEW_EDGE + abs(whole))
    moved = np.convolve(padded, kernel / kernel.sum(), mode="same")
    start = SKEW_EDGE + abs(whole) + whole
    return np.asarray(moved[start : start + signal.size])
