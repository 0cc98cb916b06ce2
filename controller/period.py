"""Means over a period of the oscillator: lock, settle rule and the watch on the rig go by them."""

import numpy as np

from vibrolock.compiled import Record, inner_kernel, kernel

__all__ = ["PERIOD"]

PERIOD = np.dtype(
    [
        ("sum_error", "f8"),
        ("sum_force", "f8"),
        ("sum_drive", "f8"),
        ("sum_held", "f8"),
        ("samples", "i8"),
        ("error_rad", "f8"),
        ("force_n", "f8"),
        ("drive_m_s2", "f8"),
        ("held", "f8"),
        ("output_v", "f8"),
        ("saturated", "i8"),
        ("clamped", "i8"),
    ]
)
"""Sums over the period under way, and the means of the last one (one record). ``held``: what the amplitude law holds (N or m).
``output_v``, ``saturated``, ``clamped``: amplitude of the output, and whether output and frequency stood at a bound, at its
end."""


@inner_kernel
def add_sample(period: Record, vibration: Record, held: float) -> None:
    """Take one sample of the vibration, and of the quantity that the amplitude law holds, into the period under way."""
    period.sum_error += vibration.error_rad
    period.sum_drive += vibration.drive_m_s2
    period.sum_force += vibration.force_n
    period.sum_held += held
    period.samples += 1


@kernel
def end_period(period: Record) -> bool:
    """The period under way is over: its means, and sums that begin again; False for one without a sample."""
    n = period.samples
    if n == 0:
        return False
    period.error_rad = period.sum_error / n
    period.force_n = period.sum_force / n
    period.drive_m_s2 = period.sum_drive / n
    period.held = period.sum_held / n
    period.sum_error = period.sum_force = period.sum_drive = period.sum_held = 0.0
    period.samples = 0
    return True
