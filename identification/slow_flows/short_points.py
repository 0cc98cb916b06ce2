"""A point of a backbone from few periods, including the approach, settled or not.

What a growing vibration feigns (joints that creep, a mean deflection that lags behind, other modes) goes with the rate of
growth, and on the approach the rate goes with the distance from the level that is approached. The properties are fitted over
the level, and so at its end they are free of it to first order. They are quadratic in the level; how far the linear fit lies
from them, beyond noise, is a systematic standard error.
"""

from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from identification.slow_flows.fits import LocalFit, noise_variances, sensor_noise
from identification.slow_flows.resonance import amplitudes_at, fit_at, resonant_vibration
from identification.slow_flows.slow_flow import SlowFlow
from vibrolock.arrays import Float

_FEWEST_PERIODS = 2.0
"""Fewest periods in a short point. Chosen."""
_STEADY = 0.02  # relative change of the amplitude below which properties are taken as linear in time
_END_PERIODS = 2.0
"""Periods at the end whose mean amplitude is that of the point. Chosen."""
_DEGREE = 2
"""Degree over the level. Chosen."""
_LARGEST_CHANGE = 0.5
"""Largest relative change of the amplitude within a short point. Chosen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ShortPoint:
    """One point, corrected to phase resonance.

    Parameters
    ----------
    vibration
        The settled vibration at phase resonance with the identified properties, to be used as a point of a `Backbone`.
    modal_frequency_hz, modal_frequency_std_hz, damping_ratio, damping_ratio_std
        Identified properties with standard errors, random and systematic together.
    phase_lag_deg
        Mean measured lag of the displacement behind the force, for which the properties are corrected.
    growth_1_s
        Mean relative growth rate of the amplitude, for which the properties are corrected too.
    force_n
        Mean measured peak of the fundamental of the force.
    periods
        Number of periods between the first and the last instant used.
    """

    vibration: PeriodicVibration
    modal_frequency_hz: float
    modal_frequency_std_hz: float
    damping_ratio: float
    damping_ratio_std: float
    phase_lag_deg: float
    growth_1_s: float
    force_n: float
    periods: float


def short_point(
    flow: SlowFlow,
    *,
    start_s: float | None = None,
    stop_s: float | None = None,
    other_modes: SlowFlow | None = None,
) -> ShortPoint:
    """Identify modal properties at the amplitude to which the vibration had come at ``stop_s``.

    Returns the point at the mean amplitude of the last two periods; where the amplitude changes by less than 2 %, at that of
    the whole part.

    Raises `IdentificationError` if there are fewer than two periods, the amplitude changes by more than half, or the
    stiffness is not positive.

    Parameters
    ----------
    flow
        Slow flow of the whole record, including the approach to the point, which the filters of velocity and displacement
        need.
    start_s, stop_s
        Begin and end of the point, seconds from the first sample; the whole flow if None. Every instant also includes one and
        a half periods before and after it.
    other_modes
        Slow flow of the same record with a receptance of the other modes that is one standard error off. What the properties
        differ by is a further systematic standard error. None where it is known.
    """
    part = flow.between(flow.time_s[0] if start_s is None else start_s, flow.time_s[-1] if stop_s is None else stop_s)
    periods = float(part.phase_periods[-1] - part.phase_periods[0])
    if periods < _FEWEST_PERIODS:
        reason = f"{periods:.2f} periods between the first and the last instant"
        raise IdentificationError(reason, field="start_s, stop_s", allowed=f"at least {_FEWEST_PERIODS:g}")
    level = np.log(part.amplitude_m)
    change = float(np.ptp(level))
    if change > _LARGEST_CHANGE:
        reason = f"the amplitude changes by {100.0 * change:.0f} %"
        allowed = f"{100.0 * _LARGEST_CHANGE:g} %"
        raise IdentificationError(reason, field="start_s, stop_s", allowed=allowed, hint="begin the point later")
    where = _where(part, level, change, periods)
    fit, random, systematic = _fitted(part, where)
    if other_modes is not None:
        other = fit_at(other_modes.between(part.time_s[0], part.time_s[-1]), where.place, where.weight, where.degree)
        systematic = np.hypot(systematic, [other.stiffness - fit.stiffness, other.damping - fit.damping])
    vibration = resonant_vibration(
        part,
        where.amplitude_m,
        fit.stiffness,
        fit.damping,
        (float(random[0]), float(random[1])),
        amplitudes_at(part, where.place, where.weight, where.degree),
        periods,
        systematic=(float(systematic[0]), float(systematic[1])),
    )
    omega, errors = float(np.sqrt(fit.stiffness)), np.hypot(random, systematic)
    return ShortPoint(
        vibration=vibration,
        modal_frequency_hz=omega / (2.0 * np.pi),
        modal_frequency_std_hz=float(errors[0]) / (4.0 * np.pi * omega),
        damping_ratio=fit.damping / (2.0 * omega),
        damping_ratio_std=float(errors[1]) / (2.0 * omega),
        phase_lag_deg=float(np.degrees(np.angle(np.mean(part.force[:, 1] * np.conj(part.drive_m))))),
        growth_1_s=float(np.mean(part.growth_1_s)),
        force_n=float(np.mean(part.force_n)),
        periods=periods,
    )


@dataclass(frozen=True, eq=False)
class _Where:
    """Amplitude of a point, places of the instants (zero at the point), their weights, and the degree over the place."""

    amplitude_m: float
    place: Float
    weight: Float
    degree: int


def _where(part: SlowFlow, level: Float, change: float, periods: float) -> _Where:
    weight = np.ones(level.size)
    if change <= _STEADY:
        middle = part.phase_periods - np.mean(part.phase_periods)
        return _Where(float(np.exp(np.mean(level))), middle / periods, weight, 1)
    end = float(np.mean(level[part.phase_periods >= part.phase_periods[-1] - _END_PERIODS]))
    return _Where(float(np.exp(end)), (level - end) / change, weight, _DEGREE)


def _fitted(part: SlowFlow, where: _Where) -> tuple[LocalFit, Float, Float]:
    """Return the fit, and float[2] each: random and systematic standard errors of stiffness and damping."""
    fit = fit_at(part, where.place, where.weight, where.degree)
    noise = noise_variances([fit])
    if not noise[0] > 0.0:  # few instants do not tell the two parts apart, and the first averages out less
        noise = sensor_noise(part.force_noise, [fit])
    random = np.array(fit.standard_errors(noise))
    if where.degree == 1:
        return fit, random, np.zeros(2)
    linear = fit_at(part, where.place, where.weight, 1)
    apart = np.array([linear.stiffness - fit.stiffness, linear.damping - fit.damping])
    by_noise = np.array(linear.standard_errors(noise))
    return fit, random, np.sqrt(np.maximum(apart**2 - np.maximum(random**2 - by_noise**2, 0.0), 0.0))
