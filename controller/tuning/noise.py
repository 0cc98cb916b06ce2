"""Choice of the demodulators' low-pass from the noise of an open-loop run at the wanted level."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vibrolock.arrays import Float
from vibrolock.errors import InputError

HIGHEST, LOWEST = 1.0 / 5.0, 1.0 / 20.0  # of the frequency: above, it does not average a period; below, it is too slow


@dataclass(frozen=True)
class LowPassChoice:
    """Chosen bandwidth of the low-pass, and the lag noise that remains."""

    low_pass_rad_s: float
    """w_LP."""
    lag_std_deg: float
    """Standard deviation of the lag with this low-pass (deg)."""
    quiet: bool
    """Whether ``lag_std_deg`` is within the requested value; if not, the lowest allowed low-pass was taken."""


def low_pass_from_densities(
    omega_rad_s: float,
    force_density: float,
    force_amplitude: float,
    acceleration_density: float,
    acceleration_amplitude: float,
    *,
    lag_std_deg: float = 0.5,
) -> LowPassChoice:
    """Return the highest w_LP at which the lag's standard deviation is at most ``lag_std_deg``, within w_0/20 and w_0/5.

    The densities are one-sided noise densities N_0 (unit^2/Hz) near the frequency; the amplitudes A are peak values. The phase
    of each signal has the variance ``N_0 w_LP/(2 A^2)``.
    """
    if not min(force_amplitude, acceleration_amplitude, omega_rad_s, lag_std_deg) > 0.0:
        reason = (
            f"acceleration_amplitude = {acceleration_amplitude:g}, omega_rad_s = {omega_rad_s:g}, "
            f"lag_std_deg = {lag_std_deg:g}"
        )
        raise InputError(reason, field="force_amplitude", value=force_amplitude, allowed="all above 0")
    per_w = 0.5 * (force_density / force_amplitude**2 + acceleration_density / acceleration_amplitude**2)
    wanted = math.radians(lag_std_deg) ** 2 / per_w if per_w > 0.0 else math.inf
    chosen = min(max(wanted, LOWEST * omega_rad_s), HIGHEST * omega_rad_s)
    return LowPassChoice(float(chosen), math.degrees(math.sqrt(per_w * chosen)), bool(wanted >= chosen))


def low_pass_from_noise(
    theta_rad: ArrayLike,
    force_n: ArrayLike,
    acceleration_m_s2: ArrayLike,
    sample_rate_hz: float,
    *,
    harmonics: int = 7,
    lag_std_deg: float = 0.5,
) -> LowPassChoice:
    """Choose w_LP from a steady open-loop record [n] at the lowest level of the test; see `low_pass_from_densities`.

    ``theta_rad`` is the oscillator's phase. Mean, linear drift, harmonics and the linear drift of the fundamental are
    subtracted. The remainder between 1/2 and 3/2 of the frequency counts as noise. Raises ValueError for fewer than 20 periods.
    """
    theta = np.unwrap(np.asarray(theta_rad, float))
    omega = (theta[-1] - theta[0]) / (theta.size - 1) * sample_rate_hz
    periods = (theta[-1] - theta[0]) / (2.0 * math.pi)
    if periods < 20.0:
        raise InputError(f"{periods:.1f} periods", field="theta_rad", allowed="at least 20")
    drift = np.linspace(-1.0, 1.0, theta.size)
    waves = [wave(h * theta) for h in range(1, harmonics + 1) for wave in (np.cos, np.sin)]
    basis = np.stack([np.ones_like(theta), drift, *waves, waves[0] * drift, waves[1] * drift], axis=1)
    (force_density, force), (acceleration_density, acceleration) = (
        _density(np.asarray(signal, float), basis, omega, sample_rate_hz) for signal in (force_n, acceleration_m_s2)
    )
    return low_pass_from_densities(
        omega, force_density, force, acceleration_density, acceleration, lag_std_deg=lag_std_deg
    )


def _density(signal: Float, basis: Float, omega: float, sample_rate_hz: float) -> tuple[float, float]:
    """Return the mean one-sided noise density around omega (unit^2/Hz), and the amplitude of the fundamental."""
    coefficients, *_ = np.linalg.lstsq(basis, signal, rcond=None)
    window = np.hanning(signal.size)
    spectrum = np.fft.rfft(window * (signal - basis @ coefficients))
    density = 2.0 * np.abs(spectrum) ** 2 / (sample_rate_hz * np.sum(window**2))
    frequency = 2.0 * math.pi * np.fft.rfftfreq(signal.size, 1.0 / sample_rate_hz) / omega
    # The fit empties the lines around omega; including them would bias the density low.
    near = (frequency > 0.5) & (frequency < 1.5) & (np.abs(frequency - 1.0) > 4.0 * frequency[1])
    return float(np.mean(density[near])), float(np.hypot(coefficients[2], coefficients[3]))
