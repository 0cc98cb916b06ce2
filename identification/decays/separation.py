"""Which modes of a decay can be told apart, and by how narrow a filter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.decays.demodulation import demodulated, leak, noise_variance
from identification.decays.extent import FLOOR
from identification.decays.tracks import Ridge, Track, found_frequencies, improved, ridge
from identification.errors import IdentificationError
from vibrolock.arrays import Float

_NAMED_WITHIN = 0.25
"""Relative distance within which a peak counts as the frequency that was named. Chosen."""
_HIGHEST_HARMONIC, _MOST_MODES = 9, 6
"""Highest order that is recognised as a harmonic of another mode, and number of modes at most. Chosen."""
_SMALL_LEAK, _LARGEST_LEAK = 3e-4, 5e-3
"""Leakage of another mode, relative to the amplitude, that is left as it is, and that is accepted at most. Chosen."""
_WINDOW_DECAY = 1.0  # largest fall of ln(amplitude) within a window, to keep neighbours out
_USUAL_DECAY = 0.16  # the same where there are none
_MOST_PERIODS = 60
"""Longest window of the demodulation, periods. Chosen."""
_GROWN = 3.0  # by how much a neighbour that decays more slowly may gain
_OF_A_HARMONIC = 0.05  # a harmonic over the one before


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mode with the length P of its filter, periods."""

    track: Track
    periods: int


@dataclass(frozen=True, eq=False)
class _Found:
    row: int
    track: Track
    asked: bool
    size: Float
    """float[n_channels]: largest amplitudes."""
    decay: float
    """Fall of ln(amplitude) per period."""

    @property
    def middle_hz(self) -> float:
        return 0.5 * (self.track.lowest_hz + self.track.highest_hz)


def separated(data: Float, rate_hz: float, near_hz: Sequence[float] | None) -> tuple[list[Candidate], tuple[str, ...]]:
    """Find the modes in a decay (float[n_channels, n]), and a filter for each that keeps the others out.

    Raises `IdentificationError` if there is none, or if a named mode is not there or cannot be told from another; modes that
    were not named and cannot be told apart are left out with a note.
    """
    found, notes = _modes(data, rate_hz, near_hz)
    chosen = []
    for one in found:
        if near_hz is not None and not one.asked:
            continue
        periods, why = _filter(one, found)
        if periods is None and one.asked:
            raise IdentificationError(why, field="near_hz")
        if periods is None:
            notes.append(f"not evaluated: {why}")
            continue
        track = improved(one.track, data[one.row], rate_hz, periods)
        if not _above_noise(data[one.row], track, rate_hz, periods):
            if one.asked:
                reason = f"the vibration at {one.middle_hz:.4g} Hz is not above the noise"
                raise IdentificationError(reason, field="near_hz")
            continue
        if any(one is not other and other.track.holds(track.start_hz) for other in found):
            why = f"the vibration at {one.middle_hz:.4g} Hz converges to that of a neighbour"
            IdentificationError.raise_if(one.asked, why, field="near_hz")
            continue
        chosen.append(Candidate(track, periods))
    if not chosen:
        raise IdentificationError(
            "; ".join(notes) or "no mode stands out of the noise; name one by `near_hz`", field="samples"
        )
    return chosen, tuple(notes)


def _modes(data: Float, rate_hz: float, near_hz: Sequence[float] | None) -> tuple[list[_Found], list[str]]:
    peaks = found_frequencies(data, rate_hz)
    found: list[_Found] = []
    notes: list[str] = []
    harmonics: list[Track] = []
    for near in near_hz or ():
        if near >= 0.5 * rate_hz:
            raise IdentificationError(f"the spectrum ends at {0.5 * rate_hz:g} Hz", field="near_hz", value=near)
        around = peaks[np.abs(peaks / near - 1.0) < _NAMED_WITHIN] if peaks.size else peaks
        at = float(around[np.argmin(np.abs(around - near))]) if around.size else near
        new = _followed(data, rate_hz, at, asked=True)
        if new is None:
            listed = ", ".join(f"{peak:.4g}" for peak in peaks[:_MOST_MODES]) or "none"
            reason = f"no vibration near {near:g} Hz"
            raise IdentificationError(reason, field="near_hz", hint=f"peaks of the spectrum, Hz: {listed}")
        if any(other.track.holds(new.track.start_hz) for other in found):
            reason = f"{near:g} Hz converges to a mode that is already named; name each once"
            raise IdentificationError(reason, field="near_hz")
        found.append(new)
    for peak in peaks:
        if len(found) >= _MOST_MODES or any(other.holds(peak) for other in (*(one.track for one in found), *harmonics)):
            continue
        new = _followed(data, rate_hz, float(peak), asked=False)
        if new is None or any(other.track.overlaps(new.track) for other in found):
            continue
        pairs = ((other, order) for other in found for order in range(2, _HIGHEST_HARMONIC + 1))
        of = next((pair for pair in pairs if pair[0].track.holds(new.middle_hz, pair[1])), None)
        if of is None:
            found.append(new)
        else:
            harmonics.append(new.track)
            notes.append(
                f"{new.middle_hz:.4g} Hz: harmonic {of[1]} of the mode at {of[0].middle_hz:.4g} Hz, or a mode that cannot be "
                "distinguished from it"
            )
    return found, notes


def _followed(data: Float, rate_hz: float, near_hz: float, *, asked: bool) -> _Found | None:
    """Follow a mode in the channel in which it stands out the most; None if there is no local maximum."""
    frequency = np.fft.rfftfreq(data.shape[1], 1.0 / rate_hz)
    power = np.abs(np.fft.rfft(data - data.mean(axis=1, keepdims=True), axis=1)) ** 2
    inside = np.abs(frequency / near_hz - 1.0) < 0.05
    share = power[:, inside].max(axis=1, initial=0.0) / np.maximum(np.median(power, axis=1), np.finfo(float).tiny)
    row = int(np.argmax(share))
    found = ridge(data[row], rate_hz, near_hz)
    if found is None:
        return None
    return _Found(row, found.track(data.shape[1], rate_hz), asked, _sizes(data, rate_hz, found), found.decay)


def _sizes(data: Float, rate_hz: float, found: Ridge) -> Float:
    """float[n_channels]: amplitudes where the ridge is largest."""
    top = int(np.argmax(found.size))
    half = 0.5 * found.window_s
    first = max(0, int((found.at_s[top] - half) * rate_hz))
    part = data[:, first : first + int(found.window_s * rate_hz)]
    window = np.hanning(part.shape[1])
    turn = np.exp(-2j * np.pi * found.frequency_hz[top] * np.arange(part.shape[1]) / rate_hz)
    return np.asarray(2.0 * np.abs((part - part.mean(axis=1, keepdims=True)) @ (window * turn)) / window.sum())


def _above_noise(signal: Float, track: Track, rate_hz: float, periods: int) -> bool:
    if track.theta_rad[-1] < 2.0 * np.pi * 8.0 * periods:
        return False
    size = np.abs(demodulated(track.theta_rad, signal[None], rate_hz, periods).values)
    return bool(size.max() > 2.0 * FLOOR * np.sqrt(noise_variance(track.theta_rad, signal[None], periods)[0]))


def _filter(one: _Found, others: Sequence[_Found]) -> tuple[int | None, str]:
    """Return the length of the filter, or None with the reason why there is none."""
    cycles = one.track.theta_rad[-1] / (2.0 * np.pi)
    longest = int(np.clip(min(_WINDOW_DECAY / (4.0 * one.decay), cycles / 16.0), 1, _MOST_PERIODS))
    shortest = int(np.clip(min(_USUAL_DECAY / (4.0 * one.decay), cycles / 64.0), 1, longest))
    found = []
    for periods in range(shortest, longest + 1):
        largest, which = max(
            (_neighbour(one, other, periods) for other in others if other is not one), default=(0.0, "")
        )
        if largest < _SMALL_LEAK:
            return periods, ""
        found.append((largest, periods, which))
    least = min(found)
    if least[0] < _LARGEST_LEAK:
        return least[1], ""
    return None, (
        f"{least[2]}; with {100.0 * one.decay / (2.0 * np.pi):.2g} % damping the filter cannot be narrower than "
        f"{longest} periods allow"
    )


def _neighbour(one: _Found, other: _Found, periods: int) -> tuple[float, str]:
    """Return what passes the filter of a neighbour and of its harmonics, relative to the mode, and what it is called."""
    own = np.array([one.track.lowest_hz, one.track.highest_hz])
    theirs = np.array([other.track.lowest_hz, other.track.highest_hz])
    gain = _GROWN * float(np.max(other.size / np.maximum(one.size, 1e-300)))
    found = [
        (
            _through(theirs, own, periods) * max(1.0, gain),
            f"the modes at {one.middle_hz:.4g} and {other.middle_hz:.4g} Hz are too close to each other",
        )
    ]
    for order in range(2, _HIGHEST_HARMONIC + 1):
        if order * theirs[0] < 2.0 * own[1]:
            text = (
                f"{one.middle_hz:.4g} Hz is near harmonic {order} of the mode at {other.middle_hz:.4g} Hz, from which it "
                "cannot be distinguished"
            )
            found.append((_through(order * theirs, own, periods) * gain * _OF_A_HARMONIC ** (order - 1), text))
    return max(found)


def _through(theirs: Float, own: Float, periods: int) -> float:
    """Largest share of frequencies ``theirs`` (float[2], a range) that passes the filter of those of a mode."""
    if theirs[0] <= own[1] and theirs[1] >= own[0]:
        return 1.0
    distance = np.abs(theirs[:, None] / own - 1.0)
    return float(np.max(leak(distance, periods)))
