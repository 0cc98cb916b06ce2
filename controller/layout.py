"""Codes and structured arrays that the kernels of the control law read and write.

Plain numpy only, so that the shell and the kernels can share it. Frequencies are angular (rad/s), angles in rad.
"""

from enum import IntEnum

import numpy as np

__all__ = [
    "LAW",
    "LOCK",
    "MOST_HARMONICS",
    "THRESHOLDS",
    "AmplitudeLaw",
    "Detector",
    "ForceLoop",
    "FrequencyLaw",
    "LockState",
]

MOST_HARMONICS = 12
"""Highest harmonic that an adaptive filter may follow."""


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
    """How force and response become complex amplitudes, and these a phase error."""

    TWO_PHASE = 0
    """Synchronous demodulation through a first-order low-pass."""
    SIGN = 1
    """Product of the signs of force and response; amplitudes as with two phases."""
    ADAPTIVE = 2
    """Adaptive filter: several harmonics and the mean at once."""


class FrequencyLaw(IntEnum):
    """What the PI law of the frequency is fed with."""

    PHASE = 0
    """The phase error, rad."""
    FREQUENCY_ERROR = 1
    """The distance of the oscillator from where the structure has the wanted phase, rad/s."""


class AmplitudeLaw(IntEnum):
    """What a level is, and so which loop makes the output's amplitude."""

    VOLTAGE = 0
    """Amplitude of the output voltage (V, peak): no loop."""
    FORCE = 1
    """Amplitude of the fundamental force (N, peak)."""
    FORCE_RMS = 2
    """Root mean square of the force without its mean, all harmonics together (N)."""
    RESPONSE = 3
    """Amplitude of the drive point's fundamental displacement (m, peak)."""


class ForceLoop(IntEnum):
    """How a force is held."""

    LINEAR = 0
    """PI law from the force error to the voltage: K3, K4 of the paper."""
    LOGARITHMIC = 1
    """PI law from the logarithm of the force ratio to that of the voltage: alike at every level."""
    THROUGH_RESPONSE = 2
    """The active force sets the level of the response, which is held by its own loop."""


SEARCHING, ACQUIRING, LOCKED, LOST = (int(state) for state in LockState)
TWO_PHASE, SIGN, ADAPTIVE = (int(detector) for detector in Detector)
PHASE, FREQUENCY_ERROR = (int(law) for law in FrequencyLaw)
VOLTAGE, FORCE, FORCE_RMS, RESPONSE = (int(law) for law in AmplitudeLaw)
LINEAR, LOGARITHMIC, THROUGH_RESPONSE = (int(loop) for loop in ForceLoop)

LAW = np.dtype(
    [
        ("dt_s", "f8"),
        ("detector", "i8"),
        ("harmonics", "i8"),
        ("target_lag_rad", "f8"),
        ("demodulator_gain", "f8"),
        ("mean_gain", "f8"),
        ("frequency_law", "i8"),
        ("kp", "f8"),
        ("ki", "f8"),
        ("mode_shape_squared", "f8"),
        ("rest_gain", "f8"),
        ("rest_share", "f8"),
        ("centre_rad_s", "f8"),
        ("lowest_rad_s", "f8"),
        ("highest_rad_s", "f8"),
        ("period_mean", "i8"),
        ("amplitude_law", "i8"),
        ("force_loop", "i8"),
        ("k3", "f8"),
        ("k4", "f8"),
        ("force_kp", "f8"),
        ("force_ki", "f8"),
        ("response_kp", "c16"),
        ("response_ki", "f8"),
        ("plant_gain", "c16"),
        ("turns", "i8"),
        ("reference_ki", "f8"),
        ("smallest_v", "f8"),
        ("largest_v", "f8"),
    ]
)
"""Frozen coefficients of the law (one record), made by `controller.law.Law.build`. ``turns``: whether the response's loop
holds its phase too, by turning the output's. ``rest_gain``: step of the low-pass behind the response's rate of change; 0 where
the laws take force and lag as they are; ``rest_share``: part of the force behind that rate which is taken out."""

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
