"""Modes in a free decay, and the phase of each over time.

A mode is a ridge of the spectrogram: a local maximum over the frequency that moves slowly. The phase along the ridge only has
to be near the true one, because the demodulation removes the rest; it is improved by what the demodulation finds.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.decays.demodulation import demodulated, noise_variance
from identification.decays.extent import FLOOR
from identification.errors import IdentificationError
from vibrolock.arrays import Bool, Float

_WINDOWS = (8, 16, 32, 64)  # periods
_FEWEST_PERIODS = 4.0
"""Fewest periods in a segment of the spectrogram. Chosen."""
_REACH, _STEP = 0.06, 0.015  # share of the frequency within which a ridge begins, and within which it goes on
_PADDING = 4
"""Length of a padded segment over that of the segment. Chosen: peaks are found between the lines."""
_NUMERIC = 1e-6  # of the largest value: below, digits end
_RIDGE_SHARE = 1e-3  # of the largest value: below, the ridge goes on with its last frequency
_QUIET = 5.0  # largest values over the median where there is noise alone
_PASSES = 2
"""Passes in which the frequency of a track is refined. Chosen."""
_SMOOTHING_WINDOWS = 4.0
"""Width of the smoothing in windows of the demodulation. Chosen."""
_SEGMENT_SHARES, _SHORTEST_SEGMENT = (20, 6), 64
"""Segments are these parts of the record, and have so many samples at least. Chosen."""
_LOWEST_LINE = 3.0  # below, an offset and its drift are in the spectrum
_ABOVE_NOISE, _OF_LARGEST = 30.0, 0.01
"""A peak counts above this multiple of the noise's power, and this share of the largest amplitude. Chosen."""
_MARGIN = 0.02
"""Relative margin of the range of a track's frequency. Chosen."""


@dataclass(frozen=True, eq=False)
class Track:
    """Phase of one mode: ``theta_rad`` float[n] of every sample; its frequencies while it is above the noise."""

    theta_rad: Float
    lowest_hz: float
    highest_hz: float
    start_hz: float

    def holds(self, frequency_hz: float, order: int = 1) -> bool:
        """Return whether a frequency lies among those of the mode, or of a harmonic of it."""
        return order * self.lowest_hz * (1.0 - _MARGIN) <= frequency_hz <= order * self.highest_hz * (1.0 + _MARGIN)

    def overlaps(self, other: "Track") -> bool:
        """Return whether the frequencies of another mode are among those of the mode."""
        low, high = self.lowest_hz * (1.0 - _MARGIN), self.highest_hz * (1.0 + _MARGIN)
        return other.lowest_hz <= high and other.highest_hz >= low


@dataclass(frozen=True, eq=False)
class Ridge:
    """A ridge of the spectrogram of one signal: ``at_s``, ``frequency_hz``, ``size`` float[m] (peak, unit of the signal)."""

    at_s: Float
    frequency_hz: Float
    size: Float
    window_s: float

    def track(self, samples: int, rate_hz: float) -> Track:
        """Return the phase of every sample."""
        values = np.interp(np.arange(samples) / rate_hz, self.at_s, self.frequency_hz)
        return _track(values, rate_hz)

    @property
    def decay(self) -> float:
        """Mean fall of ln(amplitude) per period until the amplitude is a third of its largest."""
        top = int(np.argmax(self.size))
        low = np.flatnonzero(self.size[top:] < self.size[top] / 3.0)
        end = top + int(low[0]) if low.size else self.size.size - 1
        cycles = np.mean(self.frequency_hz) * (self.at_s[end] - self.at_s[top])
        return max(float(np.log(self.size[top] / self.size[end]) / max(cycles, 1.0)), 1e-6)


def found_frequencies(data: Float, rate_hz: float) -> Float:
    """float[n]: peaks of the spectra of a decay (float[n_channels, n]), the strongest first; ridges may have several."""
    found = np.concatenate([_peaks(data, rate_hz, data.shape[1] // share) for share in _SEGMENT_SHARES], axis=1)
    return np.asarray(found[0, np.argsort(-found[1], kind="stable")])


def _peaks(data: Float, rate_hz: float, length: int) -> Float:
    """float[2, n]: frequencies of the peaks with segments of ``length`` samples, and their share of the largest power."""
    from scipy.signal import find_peaks, spectrogram

    length = max(_SHORTEST_SEGMENT, min(length, data.shape[1]))
    frequency, _, power = spectrogram(
        data, rate_hz, window="blackmanharris", nperseg=length, noverlap=3 * length // 4, nfft=2 * length
    )
    early = power[..., : max(1, power.shape[-1] // 3)].max(axis=-1)
    quiet = np.median(power, axis=(1, 2), keepdims=True)[..., 0]
    above = np.max(early / np.maximum(quiet, np.finfo(float).tiny), axis=0)
    strength = np.max(early / np.maximum(early.max(axis=1, keepdims=True), np.finfo(float).tiny), axis=0)
    above[frequency < _LOWEST_LINE * rate_hz / length] = 0.0
    peaks, _ = find_peaks(np.log(np.maximum(strength, 1e-300)), prominence=np.log(4.0))
    good = peaks[(above[peaks] > _ABOVE_NOISE) & (strength[peaks] > _OF_LARGEST**2)]
    return np.array([frequency[good], strength[good]])


def ridge(signal: Float, rate_hz: float, near_hz: float) -> Ridge | None:
    """Follow the vibration near a frequency through a signal (float[n]); None if there is no local maximum.

    Of several windows the one counts whose spectrum stands out the most: a long one, unless the frequency moves.
    """
    lengths = [round(periods * rate_hz / near_hz) for periods in _WINDOWS]
    lengths = [length for length in lengths if 4 * length <= signal.size] or [signal.size // 3]
    if lengths[0] < _FEWEST_PERIODS * rate_hz / near_hz:
        reason = f"{signal.size} samples of the decay are too few periods at {near_hz:g} Hz"
        raise IdentificationError(reason, field="samples", allowed=f"at least {3 * _FEWEST_PERIODS:g}")
    best, largest = None, 0.0
    for length in lengths:
        found = _followed(signal, rate_hz, near_hz, length)
        if found is not None and (value := float(found.size.max() * np.sqrt(length))) > largest:
            best, largest = found, value
    return best


def improved(track: Track, signal: Float, rate_hz: float, periods: int) -> Track:
    """Return the track with the frequency that its own demodulation finds in a signal (float[n])."""
    for _ in range(_PASSES):
        theta = track.theta_rad
        if theta[-1] - theta[0] < 2.0 * np.pi * periods * (4.0 + 2.0 * _SMOOTHING_WINDOWS):
            return track
        found = demodulated(theta, signal[None], rate_hz, periods)
        values, noise = found.values[0], np.sqrt(noise_variance(theta, signal[None], periods)[0])
        below = np.flatnonzero(np.abs(values) < FLOOR * max(noise, _NUMERIC * np.abs(values).max()))
        count = int(below[0]) if below.size else values.size
        if count < 2.0 * _SMOOTHING_WINDOWS:
            return track
        rate = np.gradient(np.unwrap(np.angle(values[:count])), found.at_s[:count]) / (2.0 * np.pi)
        smooth = _smoothed(found.theta_rad[:count], rate, np.abs(values[:count]), periods)
        now = np.gradient(theta) * rate_hz / (2.0 * np.pi)
        raised = np.interp(np.arange(theta.size) / rate_hz, found.at_s[:count], smooth)
        track = _track(np.maximum(now + raised, 0.2 * now), rate_hz)
    return track


def _track(frequency_hz: Float, rate_hz: float) -> Track:
    steps = 2.0 * np.pi * frequency_hz / rate_hz
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (steps[1:] + steps[:-1]))])
    return Track(theta, float(frequency_hz.min()), float(frequency_hz.max()), float(frequency_hz[0]))


def _smoothed(theta: Float, rate: Float, size: Float, periods: int) -> Float:
    """float[n]: local straight lines through ``rate``, weighted by the amplitude."""
    width = 2.0 * np.pi * periods * _SMOOTHING_WINDOWS
    out = np.empty(theta.size)
    for number in range(theta.size):
        place = (theta - theta[number]) / width
        near = np.abs(place) < 1.0
        root = np.sqrt(1.0 - place[near] ** 2) * size[near]
        design = np.column_stack([root, place[near] * root])
        out[number] = np.linalg.lstsq(design, rate[near] * root, rcond=None)[0][0]
    return out


def _followed(signal: Float, rate_hz: float, near_hz: float, length: int) -> Ridge | None:
    starts = np.arange(0, signal.size - length + 1, max(1, length // 8))
    window = np.hanning(length)
    frequency = np.asarray(np.fft.rfftfreq(_PADDING * length, 1.0 / rate_hz), np.float64)
    spectra = np.empty((starts.size, frequency.size), np.float32)
    for number, start in enumerate(starts):
        part = signal[start : start + length]
        spectra[number] = np.abs(np.fft.rfft(window * (part - part.mean()), _PADDING * length))
    inside = np.abs(frequency / near_hz - 1.0) <= max(_REACH, rate_hz / length / near_hz)
    if not inside.any():
        return None
    first = int(np.argmax(spectra[:, inside].max(axis=1)))
    peak = _peak(frequency, spectra[first], inside)
    if peak is None:
        return None
    top = peak[1]
    quiet = _QUIET * float(np.median(spectra[-max(1, starts.size // 8) :, inside]))
    floor = max(min(quiet, 0.3 * top), _RIDGE_SHARE * top)
    values = np.full((starts.size, 2), np.nan)
    values[first] = peak
    for way in (range(first + 1, starts.size), range(first - 1, -1, -1)):
        last = values[first, 0]
        for number in way:
            near = np.abs(frequency / last - 1.0) <= max(_STEP, 0.5 * rate_hz / length / last)
            peak = _peak(frequency, spectra[number], near)
            if peak is None or peak[1] < floor:
                break
            values[number], last = peak, peak[0]
    known = np.isfinite(values[:, 0])
    middle = (starts + 0.5 * length) / rate_hz
    return Ridge(middle[known], values[known, 0], values[known, 1] * 2.0 / window.sum(), length / rate_hz)


def _peak(frequency: Float, spectrum: NDArray[np.float32], inside: Bool) -> tuple[float, float] | None:
    """Frequency and value of the largest local maximum, by a parabola through the logarithm; None if there is none."""
    places = np.flatnonzero(inside)
    places = places[(places > 0) & (places < spectrum.size - 1)]
    local = places[(spectrum[places] >= spectrum[places - 1]) & (spectrum[places] > spectrum[places + 1])]
    if not local.size:
        return None
    k = int(local[np.argmax(spectrum[local])])
    a, b, c = np.log(np.maximum(spectrum[k - 1 : k + 2].astype(np.float64), 1e-300))
    shift = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c < 0.0 else 0.0
    return float(frequency[k] + np.clip(shift, -0.5, 0.5) * (frequency[1] - frequency[0])), float(spectrum[k])
