"""Choice of the demodulators' low-pass from the noise at the wanted level."""

import math
from dataclasses import dataclass

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
