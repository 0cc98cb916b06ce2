"""The longest delay from output to input that the gains of a law bear where the plant is not known.

The open loop is ``L(s) = (kp + ki/s) w_LP/(s + w_LP) T(s) exp(-s d)``. The lag of a mode that decays at the rate c, under a
force that does not answer it, answers a frequency with ``T = 1/(s + c)``. Where the law divides by c (frequency error), or
holds the logarithm of an amplitude, it is ``T = c/(s + c)``. So ``|T(i w)|`` is at most 1/w in the one case and 1 in the other,
and the crossover is at most that of this bound. The delay takes the phase ``w d`` there.

The force of a shaker drops near resonance. That raises the crossover of a phase law by up to the ratio of the decay rates with
and without the shaker, which `controller.tuning` computes for a known plant. So what is refused here is refused rightly, but
not all that should be is.
"""

import math

LARGEST_TURN_DEG = 45.0
"""Largest phase that the delay may take at the highest crossover: half of the margin of a loop that integrates."""


def highest_crossover_rad_s(kp: float, ki: float, low_pass_rad_s: float, *, integrates: bool) -> float:
    """Return the highest crossover (rad/s) that the gains can have on a mode whose force does not answer it.

    ``integrates``: whether the bound of |T| is 1/w; then the units of kp and ki are 1/s and 1/s^2, else 1 and 1/s. 0 without
    gains.
    """

    def gain(w: float) -> float:
        size = math.hypot(kp, ki / w) * low_pass_rad_s / math.hypot(w, low_pass_rad_s)
        return size / w if integrates else size

    if kp == ki == 0.0:
        return 0.0
    low, high = 1e-9, 1e9  # the gain falls all the way
    for _ in range(100):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if gain(middle) > 1.0 else (low, middle)
    return low


def longest_delay_s(crossover_rad_s: float) -> float:
    """Return the longest allowed delay at a crossover, s; infinite without one."""
    return math.radians(LARGEST_TURN_DEG) / crossover_rad_s if crossover_rad_s > 0.0 else math.inf
