"""Means over one period of the oscillator; lock, settle rule and rig supervision use them."""

from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel, kernel

PERIOD = record(
    i8="samples saturated clamped",
    f8="sum_error sum_force sum_drive sum_held error_rad force_n drive_m_s2 held output_v",
)
"""Sums over the current period, and means over the last complete period (one record).

``held``: quantity that the amplitude law holds (N or m). ``output_v``, ``saturated``, ``clamped``: at the end of the last
period, the amplitude of the output, whether the output was at its bound and whether the frequency was."""


@inner_kernel
def add_sample(period: Record, vibration: Record, held: float) -> None:
    """Add one sample of the vibration, and of the quantity that the amplitude law holds, to the current period's sums."""
    period.sum_error += vibration.error_rad
    period.sum_drive += vibration.drive_m_s2
    period.sum_force += vibration.force_n
    period.sum_held += held
    period.samples += 1


@kernel
def end_period(period: Record) -> bool:
    """Store the means of the period that has ended and reset the sums; return False if the period has no sample."""
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
