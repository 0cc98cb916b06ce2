"""The part of a force that is neither a harmonic nor noise, caused by another excited mode or an oscillating control loop."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identification.signals import EvenPhase, unwrapped
from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged
from rig.campaigns.evaluation.rows import Rows

FEWEST_PERIODS = 14  # with fewer periods, lines between two harmonics cannot be separated from the harmonics
HIGHEST_ORDER = 12.5  # times the output frequency up to which lines count; chosen: twice what any loop follows
LONGEST = 2**18  # samples whose spectrum is computed at once: with more, memory would grow with the record
MAIN_LOBE = 4.4  # half width of a line, in bins, with some room
STANDS_OUT = 15.0  # times the noise: of a million bins of noise alone, one is that high
WINDOW = (0.35875, -0.48829, 0.14128, -0.01168)  # Blackman-Harris: side lobes 92 dB down, below any converter's noise


def nonharmonic_force(bench: Bench, pieces: Sequence[Rows]) -> float:
    """Part of the force's RMS that is no harmonic and stands out of the noise, from whole records or pieces of one record.

    The spectral lines between the harmonics of the output frequency count if they exceed 15 times the noise, which is the
    median of all lines between harmonics. Therefore neither the noise of a force sensor nor harmonics above the evaluated ones
    count. Lines within ``MAIN_LOBE`` bins of a harmonic are ignored, and lines above `HIGHEST_ORDER`, where no loop acts: they
    are rounding of the output. Returns NaN if every piece is shorter than `FEWEST_PERIODS`.

    Of a piece of more than ``LONGEST`` samples, stretches of equal length are compared with their own noise each.
    """
    sums = [_sums(bench, [rows for rows in pieces if rows.size <= LONGEST])]
    for rows in pieces:
        if rows.size > LONGEST:
            borders = np.linspace(0, rows.size, math.ceil(rows.size / LONGEST) + 1).astype(int)
            sums += [_sums(bench, [rows[start:stop]]) for start, stop in pairwise(borders.tolist())]
    known = [found for found in sums if found is not None]
    if not known:
        return math.nan
    lines, power = np.sum(known, axis=0)
    return math.sqrt(lines / power)


def _sums(bench: Bench, pieces: Sequence[Rows]) -> tuple[float, float] | None:
    """Return the power of the force's lines that are neither harmonics nor noise, and its power; None if unknown."""
    spectra = [found for rows in pieces if (found := _spectrum(bench, rows)) is not None]
    if not spectra:
        return None
    power, between = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
    if not between.any() or not power.any():
        return None
    noise = float(np.median(power[between])) / math.log(2.0)
    lines = power[between & (power > STANDS_OUT * noise)] - noise
    return float(lines.sum()), float(power.sum())


def _spectrum(bench: Bench, rows: Rows) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the force's power in bins from half the output frequency, and a mask of bins between harmonics.

    Returns None if the rows are too short.
    """
    if rows.size < 2:
        return None
    theta = unwrapped(rows["theta_rad"].astype(float))
    periods = float(theta[-1] - theta[0]) / (2.0 * math.pi)
    if periods < FEWEST_PERIODS - 0.5:
        return None
    channel = bench.index_of("force")
    force = bridged(rows, slice(channel, channel + 1))[:, 0]
    window = EvenPhase(0.0, 2.0 * math.pi / force.size, force.size, len(WINDOW) - 1).signal(np.array(WINDOW))
    lines = np.fft.rfft(window * (force - force.mean()))
    power = lines.real**2 + lines.imag**2
    orders = np.arange(power.size) / (periods * force.size / (force.size - 1))
    between = np.abs(orders - np.rint(orders)) > MAIN_LOBE / periods
    kept = (orders > 0.5) & (orders < HIGHEST_ORDER)
    return power[kept], between[kept]
