"""Fundamentals of a transient over time, by complex demodulation with the phase of the oscillator.

The signal is ``y(t) = Re sum_h Y_h(t) exp(i h theta(t))`` with coefficients that change slowly compared with the period.
Multiplied by ``2 exp(-i theta)``, the fundamental becomes constant, and all other terms rotate at least once per period. A
mean over whole periods of the phase removes them: if their coefficients are constant, the static part and the harmonics
vanish for any course of the frequency. The mean is applied twice, which squares the remainder. The resulting weight is a
triangle, centred in phase, and causes no delay. The bandwidth follows the frequency f: with means over P periods, a
modulation at m Hz passes with ``sinc(P m / f)^2``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import Channel, find_name, find_role, in_newtons
from identification.errors import IdentificationError
from identification.signals.chunks import check_samples, rising_steps, unwrapped
from identification.validation import finite_array, positive, shaped_array
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_MIN_SAMPLES_PER_PERIOD = 8.0
"""Fewest samples in the shortest period. Chosen: harmonics up to the third stay below half the rate."""
_POINTS_PER_PERIOD = 16
"""Values that are returned in the shortest period, where their spacing is not given. Chosen."""
_STRETCH = 65536  # samples of all channels that are demodulated at once
_MARGIN = 64  # samples beyond a stretch that its splines include


@dataclass(frozen=True, eq=False)
class Transient(Result):
    """Fundamentals of every channel over time.

    Raises `IdentificationError` if values are NaN or infinite, shapes do not agree, there is not exactly one force
    channel, or times do not rise.

    Parameters
    ----------
    channels
        One per row of ``fundamentals``; exactly one of role ``force``. A voltage is a channel of role ``monitor``.
    time_s
        float[n], rising; time since the first sample of the record.
    frequency_hz
        float[n], instantaneous frequency of the oscillator: mean over the period around each instant.
    fundamentals
        complex[n_channels, n], peak, in the unit of each channel, against the phase of the oscillator.
    window_periods
        Length in periods of the triangular window over which each value is averaged.
    """

    channels: tuple[Channel, ...]
    time_s: Float
    frequency_hz: Float
    fundamentals: Complex
    window_periods: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        find_role(self.channels, "force")
        in_newtons(self.channels, "a transient")
        for name in ("time_s", "frequency_hz"):
            object.__setattr__(self, name, finite_array(name, getattr(self, name), np.float64, 1))
        shape = (len(self.channels), self.time_s.size)
        object.__setattr__(self, "fundamentals", shaped_array("fundamentals", self.fundamentals, np.complex128, shape))
        if self.frequency_hz.shape != self.time_s.shape:
            reason = f"{self.frequency_hz.size} values for {self.time_s.size} instants"
            raise IdentificationError(reason, field="frequency_hz")
        if not self.time_s.size or np.any(np.diff(self.time_s) <= 0.0):
            reason = f"{self.time_s.size} instants"
            raise IdentificationError(reason, field="time_s", allowed="at least one, and rising ones")

    def index(self, name: str) -> int:
        """Row of the channel called ``name``."""
        return find_name(self.channels, name)

    def fundamental(self, name: str) -> Complex:
        """complex[n]: fundamental of the channel called ``name``, peak, in its unit."""
        return np.asarray(self.fundamentals[self.index(name)])

    @property
    def force(self) -> Complex:
        """complex[n]: fundamental of the force, peak, N."""
        return np.asarray(self.fundamentals[find_role(self.channels, "force")])


def demodulate(
    theta_rad: ArrayLike,
    samples: ArrayLike,
    channels: Sequence[Channel],
    *,
    sample_rate_hz: float,
    periods: int = 1,
    every: int | None = None,
) -> Transient:
    """Compute the fundamentals over time of a record with known phase of the oscillator.

    Returns the fundamentals without the first P and the last P periods, where the window would be incomplete.

    Raises `IdentificationError` if values are NaN or infinite, lengths differ, the phase falls, there are fewer than 8
    samples per period, or the record is too short.

    Parameters
    ----------
    theta_rad, samples, channels, sample_rate_hz
        As for `periodic_vibration`; exactly one channel of role ``force``.
    periods
        Number of periods P of each of the two means. One period resolves fast changes best; more periods leave less noise,
        but raise a narrow minimum that is passed fast.
    every
        Spacing of the result in samples; about sixteen values per shortest period if None.
    """
    theta = unwrapped(finite_array("theta_rad", theta_rad, np.float64, 1))
    single = np.asarray(samples).dtype == np.float32  # as recorded; stretches are computed in double precision
    data = finite_array("samples", samples, np.float32 if single else np.float64, 2)
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    check_samples(data, channels, theta.size)
    IdentificationError.unless_at_least("periods", periods, 1)
    shortest = 2.0 * np.pi / _largest_step(theta, periods)
    stride = max(1, int(shortest / _POINTS_PER_PERIOD)) if every is None else every
    IdentificationError.raise_if(stride < 1, field="every", value=every, allowed="at least 1")
    reach = np.pi * periods
    once = _whole_windows(theta, slice(0, theta.size), reach)
    twice = _whole_windows(theta, once, reach)
    at = np.arange(twice.start, twice.stop, stride)
    # The mean frequency over the period around each sample is exact if the frequency changes linearly.
    half, here = np.pi / np.gradient(theta)[at], np.arange(theta.size)
    advance = np.interp(at + half, here, theta) - np.interp(at - half, here, theta)
    return Transient(
        channels=tuple(channels),
        time_s=at / rate_hz,
        frequency_hz=advance / half * rate_hz / (4.0 * np.pi),
        fundamentals=_fundamentals(theta, data, at, reach),
        window_periods=2 * periods,
    )


def _largest_step(theta: Float, periods: int) -> float:
    """Return the largest advance of the phase per sample, rad; raise `IdentificationError` if the phase cannot be used."""
    steps = rising_steps(theta)
    covered = float(theta[-1] - theta[0]) / (2.0 * np.pi) if theta.size else 0.0
    needed = 2 * periods + 1
    if covered < needed:
        allowed = f"{needed} with periods = {periods}"
        raise IdentificationError(f"covers {covered:.2f} periods", field="theta_rad", allowed=allowed)
    per_period = 2.0 * np.pi / float(steps.max())
    if per_period < _MIN_SAMPLES_PER_PERIOD:
        reason = f"{per_period:.2f} samples in the shortest period"
        raise IdentificationError(reason, field="theta_rad", allowed=f"at least {_MIN_SAMPLES_PER_PERIOD:g}")
    return float(steps.max())


def _whole_windows(theta: Float, known: slice, reach: float) -> slice:
    """Return the samples whose window, ``reach`` of phase to either side, lies within the samples ``known``."""
    first = int(np.searchsorted(theta, theta[known.start] + reach))
    end = int(np.searchsorted(theta, theta[known.stop - 1] - reach, side="right"))
    return slice(first, end)


def _fundamentals(theta: Float, signals: Float, at: NDArray[np.intp], reach: float) -> Complex:
    """complex[n_channels, len(at)]: fundamentals of ``signals`` at the samples ``at``, stretch by stretch.

    The splines of a whole record would take half a kilobyte per sample and channel; the effect of a cut on them decays by 0.27
    per sample. All channels have the nodes of their splines in common.
    """
    out = np.empty((signals.shape[0], at.size), np.complex128)
    most = _STRETCH // signals.shape[0]
    step = max(1, most // max(1, int(at[1] - at[0]))) if at.size > 1 else 1
    for first in range(0, at.size, step):
        some = at[first : first + step]
        start = max(0, int(np.searchsorted(theta, theta[some[0]] - 2.0 * reach)) - _MARGIN)
        stop = int(np.searchsorted(theta, theta[some[-1]] + 2.0 * reach)) + _MARGIN
        part = signals[:, start:stop].T.astype(np.float64)
        out[:, first : first + step] = _of_stretch(theta[start:stop], part, some - start, reach).T
    return out


def _of_stretch(theta: Float, signals: Float, at: NDArray[np.intp], reach: float) -> Complex:
    """complex[len(at), n_channels]: fundamentals of a stretch of signals, float[n, n_channels].

    A mean is a difference of the antiderivative of an interpolating spline. Windows end between samples, because a period is
    seldom a whole number of samples.
    """
    from scipy.interpolate import CubicSpline  # a third of a second, for sweeps alone

    once = _whole_windows(theta, slice(0, theta.size), reach)
    integral = CubicSpline(theta, 2.0 * np.exp(-1j * theta)[:, None] * signals).antiderivative()
    mean = (integral(theta[once] + reach) - integral(theta[once] - reach)) / (2.0 * reach)
    again = CubicSpline(theta[once], mean).antiderivative()
    return np.asarray((again(theta[at] + reach) - again(theta[at] - reach)) / (2.0 * reach))
