"""Where a loop with the averaged sign detector mean(sign F sign(-A)) = 0 comes to rest: preset A's bias."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from tests.reference.balance import Balance, Conditions
from tests.reference.coupled_rig import CoupledRig
from tests.reference.harmonic_balance import RESONANCE_DEG, SAMPLES, Periodic, periodic, sequence, solve
from vibrolock.arrays import Float

# the fourth mode answers the 29th harmonic strongly enough to move the zero crossings by up to two degrees
HARMONICS = 35


def mean_sign_product(one: Float, other: Float) -> float:
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


def sign_lock(rig: CoupledRig, voltages_v: Sequence[float]) -> list[Periodic]:
    """States where the averaged detector rests, at the given voltage amplitudes, lowest first.

    The rest point next to phase resonance is taken, walking down the detector's characteristic, which falls with lag.
    """
    balance = Balance(rig, HARMONICS, SAMPLES)
    points = [Conditions(voltage_v=voltage, lag_deg=RESONANCE_DEG) for voltage in voltages_v]
    return [_rest_point(balance, state) for state in sequence(balance, points)]


def _rest_point(balance: Balance, resonance: Periodic, step_deg: float = 3.0) -> Periodic:
    """Walk in lag from a phase-resonant state at fixed voltage until the detector changes sign, then find the zero."""
    here = balance.unknowns(resonance.magnet_m, resonance.delta, resonance.omega_rad_s, resonance.voltage_v)

    def at(lag_deg: float) -> tuple[Float, Periodic]:
        y, _ = solve(balance, Conditions(voltage_v=resonance.voltage_v, lag_deg=lag_deg), here)
        return y, periodic(balance, y)

    lag, output = RESONANCE_DEG, detector_output(resonance)
    step = float(np.copysign(step_deg, output))
    for _ in range(int(80.0 / step_deg)):
        after, state = at(lag + step)
        if detector_output(state) * output <= 0.0:
            return at(brentq(lambda trial: detector_output(at(trial)[1]), lag, lag + step, xtol=1e-6))[1]
        here, lag = after, lag + step
    raise ArithmeticError(f"no rest point within 80 degrees at {resonance.voltage_v} V")
