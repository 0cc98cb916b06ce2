"""Codes and structured arrays that the kernels of the control law read and write.

Plain numpy only, so that the shell and the kernels can share it. Frequencies are angular (rad/s), angles in rad.
"""

from enum import IntEnum

import numpy as np

__all__ = ["LAW", "LOCK", "THRESHOLDS", "AmplitudeLaw", "Detector", "LockState"]


class LockState(IntEnum):
    """State of the phase lock."""

    SEARCHING = 0
    """Force or response is too small for its phase to be read; the frequency is held."""
    ACQUIRING = 1
    """The loop is closed and not yet close to the wanted phase."""
    LOCKED = 2
    """The phase error has stayed small for several periods."""
    LOST = 3
    """Was locked; the error has been large for several periods while the level was held. A fault."""


class Detector(IntEnum):
    """How the phase error is measured."""

    TWO_PHASE = 0
    SIGN = 1


class AmplitudeLaw(IntEnum):
    """What the level of a plan is."""

    VOLTAGE = 0
    """The level is the amplitude of the output voltage (V, peak)."""
    FORCE = 1
    """The level is the amplitude of the fundamental force (N, peak), held by a PI law on the voltage."""


SEARCHING, ACQUIRING, LOCKED, LOST = (int(state) for state in LockState)
TWO_PHASE, SIGN = (int(detector) for detector in Detector)
VOLTAGE, FORCE = (int(law) for law in AmplitudeLaw)

LAW = np.dtype(
    [
        ("dt_s", "f8"),
        ("detector", "i8"),
        ("target_lag_rad", "f8"),
        ("demodulator_gain", "f8"),
        ("mean_gain", "f8"),
        ("kp", "f8"),
        ("ki", "f8"),
        ("centre_rad_s", "f8"),
        ("lowest_rad_s", "f8"),
        ("highest_rad_s", "f8"),
        ("amplitude_law", "i8"),
        ("k3", "f8"),
        ("k4", "f8"),
        ("largest_v", "f8"),
        ("period_mean", "i8"),
    ]
)
"""Frozen coefficients of the law (one record), made by `controller.pll.PhaseLockedLoop.build`."""

THRESHOLDS = np.dtype(
    [
        ("locked_rad", "f8"),
        ("locked_periods", "i8"),
        ("lost_rad", "f8"),
        ("lost_periods", "i8"),
        ("smallest_force_n", "f8"),
        ("smallest_response", "f8"),
    ]
)
"""When a lock is gained and lost (one record)."""

LOCK = np.dtype([("state", "i8"), ("close_periods", "i8"), ("far_periods", "i8")])
"""State of the phase lock (one record)."""
