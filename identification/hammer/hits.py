"""Find the hits of a hammer in a record of the force, and the pulse of each.

The force of a hammer is zero but for pulses of a few milliseconds. Its noise is therefore known from the same record: the
median of the modulus, over 0.6745, is the standard deviation of normal noise, whatever the few samples of the pulses are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from vibrolock.arrays import Float

_NOISE = 8.0
"""Least height of a pulse, in standard deviations of the noise."""
_SHARE = 0.1
"""Least height of a pulse, relative to the highest of all records, unless a trigger level is given."""
_FOOT = 0.02
"""The pulse begins and ends at this share of its peak, or in the noise."""


@dataclass(frozen=True)
class Pulse:
    """A pulse of the force, in samples of its record."""

    first: int
    """First sample of the pulse."""
    peak: int
    """Its highest sample."""
    end: int
    """First sample after it."""
    height_n: float
    """Force at the peak."""

    @property
    def width(self) -> int:
        """Duration in samples."""
        return self.end - self.first


def noise_rms(force: Float) -> float:
    """Return the RMS of the noise of a force that is zero most of the time."""
    return float(np.median(np.abs(force - np.median(force))) / 0.6745)


def found_pulses(forces: Sequence[Float], trigger_n: float | None, apart: int) -> list[list[list[Pulse]]]:
    """Return the pulses of every record, those that follow within ``apart`` samples of a first one in a list with it.

    ``forces`` are without offset, pulses upwards. Raises `IdentificationError` if there is no pulse.
    """
    highest = max(float(np.max(force)) for force in forces)
    noise = max(noise_rms(force) for force in forces)
    level = max(_SHARE * highest, _NOISE * noise) if trigger_n is None else trigger_n
    if highest <= level:
        raise IdentificationError(
            f"no hit above {level:.3g} N, the highest sample is {highest:.3g} N and noise has {noise:.3g} N "
            "RMS; lower trigger_n, or is the polarity of the force reversed?",
            field="force",
        )
    return [_grouped(_pulses(force, level), apart) for force in forces]


def _pulses(force: Float, level: float) -> list[Pulse]:
    above = np.concatenate([[False], force > level, [False]])
    rises, falls = np.flatnonzero(~above[:-1] & above[1:]), np.flatnonzero(above[:-1] & ~above[1:])
    noise, found = noise_rms(force), list[Pulse]()
    for rise, fall in zip(rises, falls, strict=True):
        peak = int(rise + np.argmax(force[rise:fall]))
        foot = max(_FOOT * force[peak], 3.0 * noise)
        before, after = force[:peak] <= foot, force[peak:] <= foot
        first = peak - int(np.argmax(before[::-1])) if before.any() else 0
        end = peak + int(np.argmax(after)) if after.any() else force.size
        if not found or first >= found[-1].end:
            found.append(Pulse(first, peak, end, float(force[peak])))
        elif force[peak] > found[-1].height_n:
            found[-1] = Pulse(found[-1].first, peak, max(end, found[-1].end), float(force[peak]))
    return found


def _grouped(pulses: list[Pulse], apart: int) -> list[list[Pulse]]:
    groups: list[list[Pulse]] = []
    for pulse in pulses:
        if groups and pulse.first - groups[-1][0].first < apart:
            groups[-1].append(pulse)
        else:
            groups.append([pulse])
    return groups
