"""A point of a backbone from few periods, including the approach, settled or not."""

from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from identification.slow_flows.fits import noise_variances
from identification.slow_flows.resonance import amplitudes_at, fit_at, resonant_vibration
from identification.slow_flows.slow_flow import SlowFlow

_FEWEST_PERIODS = 2.0
"""Fewest periods in a short point. Chosen."""
_STEADY = 0.02  # relative change of the amplitude below which properties are taken as linear in time
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
        Identified properties with standard errors.
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


def short_point(flow: SlowFlow, *, start_s: float | None = None, stop_s: float | None = None) -> ShortPoint:
    """Identify modal properties at the amplitude that the vibration had from ``start_s`` to ``stop_s``.

    Returns the point at the mean amplitude of this part.

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
    centre = float(np.mean(level))
    middle = part.phase_periods - np.mean(part.phase_periods)
    place = (level - centre) / change if change > _STEADY else middle / periods
    weight = np.ones(place.size)
    fit = fit_at(part, place, weight, 1)
    errors = fit.standard_errors(noise_variances([fit]))
    size = float(np.exp(centre))
    vibration = resonant_vibration(
        part, size, fit.stiffness, fit.damping, errors, amplitudes_at(part, place, weight, 1), periods
    )
    omega = float(np.sqrt(fit.stiffness))
    return ShortPoint(
        vibration=vibration,
        modal_frequency_hz=omega / (2.0 * np.pi),
        modal_frequency_std_hz=errors[0] / (4.0 * np.pi * omega),
        damping_ratio=fit.damping / (2.0 * omega),
        damping_ratio_std=errors[1] / (2.0 * omega),
        phase_lag_deg=float(np.degrees(np.angle(np.mean(part.force[:, 1] * np.conj(part.drive_m))))),
        growth_1_s=float(np.mean(part.growth_1_s)),
        force_n=float(np.mean(part.force_n)),
        periods=periods,
    )
