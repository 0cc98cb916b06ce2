"""Records of the watch on whether force and motion follow the output."""

import numpy as np

__all__ = ["EXPECTED", "FOLLOWING"]

EXPECTED = np.dtype(
    [
        ("known", "i8"),
        ("force_v_n", "f8", (4,)),
        ("acceleration_v_s2_m", "f8", (4,)),
        ("centre_rad_s", "f8"),
        ("lowest_rad_s", "f8"),
        ("highest_rad_s", "f8"),
        ("noise_n", "f8"),
        ("noise_m_s2", "f8"),
        ("visible_n", "f8"),
        ("visible_m_s2", "f8"),
        ("floor_v", "f8"),
        ("force_skew_s", "f8"),
        ("drive_skew_s", "f8"),
    ]
)
"""What is known beforehand (one record). ``known``: whether there is an exciter ``u = alpha F + beta A``, with its
coefficients as in `controller.tuning.PlantModel` and the band in which they hold. ``noise_``: amplitudes below which it is
not judged by. ``visible_``: amplitudes from which on a force or acceleration is told from noise. ``floor_v``: output that is
never too much. ``_skew_s``: delays of the two channels."""

FOLLOWING = np.dtype(
    [
        ("alpha", "c16"),
        ("beta", "c16"),
        ("alpha_rate", "c16"),
        ("beta_rate", "c16"),
        ("sent", "c16"),
        ("late_sent", "c16"),
        ("late_force", "c16"),
        ("late_drive", "c16"),
        ("needed", "c16"),
        ("told", "i8"),
        ("unlike_s", "f8"),
        ("most_unlike_s", "f8"),
        ("silent_periods", "i8"),
        ("reference_v", "f8"),
        ("reference_level", "f8"),
        ("reference_other", "f8"),
        ("astray_periods", "i8"),
        ("largest_rise", "f8"),
        ("most_periods", "i8"),
    ]
)
"""State of the watch (one record). ``alpha``, ``beta``: exciter at this period's frequency, ``_rate`` their derivatives by s,
``told``: whether they are known apart there. ``sent``: complex output as the detector's filter would show it, ``late_`` what
has passed that filter once more, ``needed``: output that the known exciter needs for it. ``unlike_s``: time without a break in
which the two contradict each other, ``most_unlike_s`` the longest. ``silent_periods`` in which one of force and motion showed
nothing and the other much. ``reference_``: output (V), held quantity and the other of
force and motion when the held quantity last followed. ``astray_periods`` since in which it did not, ``most_periods`` of these
there ever were, ``largest_rise`` of the output above its reference in them."""
