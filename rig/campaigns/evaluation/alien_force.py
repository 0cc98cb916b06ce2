"""The part of a force that is neither a harmonic nor noise: another mode that the loop excites, or a loop that oscillates."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged

__all__ = ["FEWEST_PERIODS", "alien_force"]

FEWEST_PERIODS = 14  # in fewer, what lies between two harmonics is not told from them
MAIN_LOBE = 4.4  # half width of a line, in bins, with some room
STANDS_OUT = 15.0  # times the noise: of a million bins of noise alone, one is that high
WINDOW = (0.35875, -0.48829, 0.14128, -0.01168)  # Blackman-Harris: side lobes 92 dB down, below any converter's noise


def alien_force(bench: Bench, pieces: Sequence[np.ndarray]) -> float:
    """Part of the force's RMS, in rows of whole records or pieces of one, that is no harmonic and stands out of noise.

    Counted are the lines of the spectrum between the harmonics of the output's frequency that are 15 times the noise there;
    noise is the median of all lines there. So neither a noisy force sensor nor harmonics beyond those that are evaluated
    raise the result. Lines within ``MAIN_LOBE`` bins of a harmonic are not counted. NaN where every piece is shorter
    than `FEWEST_PERIODS`.
    """
    spectra = [found for rows in pieces if (found := _spectrum(bench, rows)) is not None]
    if not spectra:
        return math.nan
    power, between = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
    if not between.any() or not power.any():
        return math.nan
    noise = float(np.median(power[between])) / math.log(2.0)
    lines = power[between & (power > STANDS_OUT * noise)] - noise
    return math.sqrt(float(lines.sum() / power.sum()))


def _spectrum(bench: Bench, rows: np.ndarray) -> tuple[np.ndarray, Any] | None:
    """Power of the force in bins from half the frequency on, and which of them lie between harmonics; None: too short."""
    if rows.size < 2:
        return None
    theta = np.unwrap(rows["theta_rad"].astype(float))
    periods = float(theta[-1] - theta[0]) / (2.0 * math.pi)
    if periods < FEWEST_PERIODS - 0.5:
        return None
    force = bridged(rows)[:, bench.index_of("force")]
    turns = 2.0 * math.pi * np.arange(force.size) / force.size
    window = sum(factor * np.cos(order * turns) for order, factor in enumerate(WINDOW))
    power = np.abs(np.fft.rfft(window * (force - force.mean()))) ** 2
    orders = np.arange(power.size) / (periods * force.size / (force.size - 1))
    between = np.abs(orders - np.rint(orders)) > MAIN_LOBE / periods
    kept = orders > 0.5
    return power[kept], between[kept]
