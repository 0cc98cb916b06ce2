"""Where a loop with the averaged sign detector mean(sign F sign(-A)) = 0 comes to rest: preset A's bias."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from tests.reference.balance import Balance, Conditions
from tests.reference.coupled_rig import CoupledRig, Vector
from tests.reference.harmonic_balance import (
    HARMONICS,
    RESONANCE_DEG,
    SAMPLES,
    Periodic,
    linear_start,
    periodic,
    sequence,
    solve,
)


def mean_sign_product(one: Vector, other: Vector) -> float:
    """Mean of sign(one) sign(other) over one period, zero crossings interpolated linearly between the samples."""
    edges = [np.arange(one.size + 1.0)]
    closed = [np.append(signal, signal[0]) for signal in (one, other)]
    for signal in closed:
        at = np.flatnonzero(signal[:-1] * signal[1:] < 0.0)
        edges.append(at + signal[at] / (signal[at] - signal[at + 1]))
    times = np.sort(np.concatenate(edges))
    middle, grid = 0.5 * (times[1:] + times[:-1]), edges[0]
    signs = np.sign(np.interp(middle, grid, closed[0])) * np.sign(np.interp(middle, grid, closed[1]))
    return float(np.sum(signs * np.diff(times))) / one.size


def detector_output(state: Periodic, samples: int = 2048) -> float:
    """The averaged detector on the measured force without its mean and the true drive acceleration."""
    theta = 2.0 * np.pi * np.arange(samples) / samples
    order = np.arange(state.force_n.size)
    force = np.where(order > 0, state.force_n, 0.0)
    minus_acceleration = (order * state.omega_rad_s) ** 2 * state.drive_m
    return mean_sign_product(state.waveform(force, theta), state.waveform(minus_acceleration, theta))
