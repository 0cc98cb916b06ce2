"""A predicted frequency response at constant force, the peak of a sampled curve, and the band of several predictions."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_NEAR_THE_TOP = 0.9  # smallest neighbour of the largest point, relative, for a parabola through them; chosen

FLAGGED_BEYOND = 1.25  # use of the identified range above which a prediction has a note (decision 24)


def peak_of(amplitude: Float, *columns: Float) -> tuple[float, ...]:
    """Return the largest amplitude of a curve, by a parabola through the three highest points, and the other columns there.

    Points are taken as evenly spaced along the curve. The result is the largest point itself if one of its neighbours is
    missing or is so much smaller that the curve jumps there or is too coarsely sampled.
    """
    top = int(np.argmax(amplitude))
    values = np.column_stack([amplitude, *columns])
    if not 0 < top < amplitude.size - 1:
        return tuple(values[top].tolist())
    before, here, after = amplitude[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    if min(before, after) < _NEAR_THE_TOP * here or bend == 0.0:
        return tuple(values[top].tolist())
    shift = 0.5 * (before - after) / bend
    weights = np.array([0.5 * shift * (shift - 1.0), 1.0 - shift**2, 0.5 * shift * (shift + 1.0)])
    return tuple((weights @ values[top - 1 : top + 2]).tolist())


@dataclass(frozen=True)
class Peak:
    """Largest amplitude of a response: peak displacement, its frequency and phase lag, and the modal amplitude."""

    amplitude_m: float
    frequency_hz: float
    phase_lag_deg: float
    modal_amplitude: float


@dataclass(frozen=True, eq=False, kw_only=True)
class SteadyPrediction(Result):
    """Frequency response at constant force, along its branches: from below resonance over the peak to above.

    Parameters
    ----------
    force_n
        Held level: peak of the fundamental of the force (N), its RMS (N) if ``force`` is ``rms``, or the amplitude of the
        voltage (V) if ``force`` is ``voltage``.
    force
        Held quantity. ``fundamental`` and ``rms``: that of a force with harmonics as recorded or as the exciter causes them.
        ``pure-sine``: a force without harmonics. ``voltage``: a sine of voltage. ``recorded``: each point has its recorded
        force, and ``force_n`` is the median of these forces.
    channels
        Names of the measurement points, the drive point first.
    frequency_hz, modal_amplitude, fundamental_n
        float[n], frequency of the vibration (Hz), q (kg^1/2 m; NaN if unknown), peak of the fundamental of the force (N).
    displacement_m
        complex[n, n_channels], fundamental of the displacement, peak, against the phase of the force.
    stable
        bool[n], stability under constant force and frequency, by the eigenvalues of the slow flow or of the disturbed
        vibration.
    branch
        int[n], 0 for the response that begins at rest, 1 and above for detached branches, or for the part reached from the
        other end of the band if the first response leaves the allowed range of the model.
    range_use
        float[n], modal amplitude over the largest identified, states over the largest in the training data, or displacement
        of a nonlinear element over the reach of its laws; NaN where that is unknown.
    fold_frequency_hz, fold_amplitude_m, fold_modal_amplitude
        float[n_folds], points where the response turns back in frequency; amplitude of the drive point.
    notes
        Remarks on the prediction, one line each.
    complete
        Whether every path reached the far end of the band; else it was cut off, and a note says where and why.
    """

    force_n: float
    force: str
    channels: tuple[str, ...]
    frequency_hz: Float
    modal_amplitude: Float
    fundamental_n: Float
    displacement_m: Complex
    stable: NDArray[np.bool_]
    branch: NDArray[np.int64]
    range_use: Float
    fold_frequency_hz: Float
    fold_amplitude_m: Float
    fold_modal_amplitude: Float
    notes: tuple[str, ...] = ()
    complete: bool = True

    @property
    def name(self) -> str:
        """Label of the prediction for tables."""
        if self.force == "voltage":
            return f"{self.force_n:g} V"
        kind = {"fundamental": "", "rms": " RMS", "pure-sine": " pure sine", "recorded": " recorded"}[self.force]
        return f"{self.force_n:g} N{kind}"

    def motion_m(self, channel: str | None = None) -> Complex:
        """complex[n]: fundamental of the displacement at a channel; at the drive point if None."""
        if channel is None:
            return np.asarray(self.displacement_m[:, 0])
        if channel not in self.channels:
            raise IdentificationError(f"no channel '{channel}' was predicted; there are {', '.join(self.channels)}")
        return np.asarray(self.displacement_m[:, self.channels.index(channel)])

    def amplitude_m(self, channel: str | None = None) -> Float:
        """float[n]: peak displacement at a channel; at the drive point if None."""
        return np.abs(self.motion_m(channel))

    def acceleration_m_s2(self, channel: str | None = None) -> Complex:
        """complex[n]: fundamental of the acceleration at a channel; at the drive point if None."""
        return np.asarray(-((2.0 * np.pi * self.frequency_hz) ** 2) * self.motion_m(channel))

    def phase_lag_deg(self, channel: str | None = None) -> Float:
        """float[n]: lag of the displacement behind the force, 0 to 360; 90 is phase resonance."""
        return np.asarray(np.degrees(-np.angle(self.motion_m(channel))) % 360.0)

    def peak(self, channel: str | None = None) -> Peak:
        """Return the largest amplitude on the main branch, by a parabola through the three highest points.

        If the response was cut off, this is a peak only if `peak_reached` is true.
        """
        main = self.branch == 0
        columns = (self.amplitude_m(channel), self.frequency_hz, self.phase_lag_deg(channel), self.modal_amplitude)
        return Peak(*peak_of(*(column[main] for column in columns)))

    def peak_reached(self, channel: str | None = None, *, order: int = 0) -> bool:
        """Return whether the largest amplitude is a peak, and not the end of a response that was cut off on its way up.

        The displacement is differentiated ``order`` times. Its largest value over all branches is no peak if it is the last
        point of a branch, or if it lies on another branch than the main branch, which `peak` describes.
        """
        if self.complete:
            return True
        amplitude = self.amplitude_m(channel) * (2.0 * np.pi * self.frequency_hz) ** order
        top = int(np.argmax(amplitude))
        last = top + 1 == amplitude.size or self.branch[top + 1] != self.branch[top]
        return bool(self.branch[top] == 0 and not last)


_POINTS = 121
"""Phase lags of a band, from 10 to 170 degrees. Chosen."""
_INTERVAL = (2.5, 97.5)
"""Percentiles of a band, which holds 95 %."""
_TWO_SIDED_95 = 1.96


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseBand(Result):
    """Uncertainty of a predicted response at the drive point.

    Parameters
    ----------
    phase_lag_deg
        float[n], phase lags of the displacement, rising.
    amplitude_m, frequency_hz
        float[2, n], ends of the 95 % intervals at each lag.
    peak_amplitude_std_m, peak_frequency_std_hz
        Standard deviations of the largest amplitude and its frequency.
    draws
        Number of draws.
    """

    phase_lag_deg: Float
    amplitude_m: Float
    frequency_hz: Float
    peak_amplitude_std_m: float
    peak_frequency_std_hz: float
    draws: int


def band_of_responses(responses: Iterable[SteadyPrediction]) -> ResponseBand:
    """Return the band of several predictions of the same response, two at least, by their branches that begin at rest."""
    lags = np.linspace(10.0, 170.0, _POINTS)
    curves, peaks = [], []
    for found in responses:
        curves.append(_over_lags(found, lags))
        peak = found.peak()
        peaks.append((peak.amplitude_m, peak.frequency_hz))
    spread = np.std(peaks, axis=0, ddof=1)
    amplitude, frequency = np.percentile(curves, _INTERVAL, axis=0).swapaxes(0, 1)
    return ResponseBand(
        phase_lag_deg=lags,
        amplitude_m=amplitude,
        frequency_hz=frequency,
        peak_amplitude_std_m=float(spread[0]),
        peak_frequency_std_hz=float(spread[1]),
        draws=len(peaks),
    )


def widened(
    band: ResponseBand,
    response: SteadyPrediction,
    families: Sequence[Sequence[SteadyPrediction]],
    amplitude_error: float,
    frequency_error: float,
) -> ResponseBand:
    """Return a band that also holds other responses and an error.

    The ends of the band move by how far the responses of each family differ from ``response`` that way, all families
    together. The standard errors become those of a symmetric 95 % interval that holds all of it.

    Parameters
    ----------
    band
        The band.
    response
        Response that it is of.
    families
        Other responses that are possible, by what makes them differ.
    amplitude_error, frequency_error
        Further errors relative to amplitude and frequency.
    """
    own, peak = _over_lags(response, band.phase_lag_deg), response.peak()
    ends = np.array([band.amplitude_m, band.frequency_hz])
    own_peak = np.array([peak.amplitude_m, peak.frequency_hz])
    half = _TWO_SIDED_95 * np.array([band.peak_amplitude_std_m, band.peak_frequency_std_hz])
    for family in families:
        moved = np.array([_over_lags(one, band.phase_lag_deg) for one in family]) - own
        ends[:, 0] += np.minimum(np.min(moved, axis=0), 0.0)
        ends[:, 1] += np.maximum(np.max(moved, axis=0), 0.0)
        peaks = np.array([(one.peak().amplitude_m, one.peak().frequency_hz) for one in family])
        half += np.max(np.abs(peaks - own_peak), axis=0)
    errors = np.array([amplitude_error, frequency_error])
    more = errors[:, None] * own
    half += errors * own_peak
    return replace(
        band,
        amplitude_m=np.array([np.maximum(ends[0, 0] - more[0], 0.0), ends[0, 1] + more[0]]),
        frequency_hz=np.array([np.maximum(ends[1, 0] - more[1], 0.0), ends[1, 1] + more[1]]),
        peak_amplitude_std_m=float(half[0] / _TWO_SIDED_95),
        peak_frequency_std_hz=float(half[1] / _TWO_SIDED_95),
    )


def _over_lags(response: SteadyPrediction, lags: Float) -> Float:
    """float[2, n]: amplitude and frequency of the branch that begins at rest, at phase lags."""
    main = response.branch == 0
    lag = response.phase_lag_deg()[main]
    return np.array([np.interp(lags, lag, row[main]) for row in (response.amplitude_m(), response.frequency_hz)])
