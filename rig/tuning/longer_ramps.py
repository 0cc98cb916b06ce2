"""Ramps of a tuned plan that take longer than others, because the phase lagged in them when the plan was tried."""

import math
from collections.abc import Sequence
from itertools import pairwise

from rig.campaigns.backbone.ramps import Ramp

LAGGED_DEG = 10.0  # phase error in a ramp beyond which the plan's takes longer; chosen
WANTED_DEG = 4.0  # what it is made longer for; chosen: at a stop a lag falls by less than in proportion to the rate
NOISE_STDS = 3.0  # of the phase's noise, which are no lag: some hundred periods have one as large
LEAST_FACTOR, MOST_FACTOR = 1.2, 10.0  # times that a ramp is made longer, if it is; chosen


def ramp_factors(ramps: Sequence[Ramp], levels: Sequence[float]) -> tuple[float, ...]:
    """Return how many times as long the ramp to each level is to be, after a trial; none if all may be as they are.

    The phase lags by the rate at which a ramp changes the level. Ramps over levels in which the trial lagged by more than
    `LAGGED_DEG`, above noise, are to lag by `WANTED_DEG`; ramps that are longer already, and need not be, become shorter again.
    The ramp after one that lagged began slower (`controller.lock`), which it does no longer: it becomes as long as it took, but
    no longer than the one before.
    """
    slowest = [0.0] * len(levels)
    before = 1.0
    for ramp in ramps:
        lag_deg = ramp.error_deg - NOISE_STDS * ramp.noise_deg
        needed = ramp.planned * lag_deg / WANTED_DEG
        if lag_deg <= LAGGED_DEG:
            slower = min(ramp.taken, before) if ramp.taken > LEAST_FACTOR * ramp.planned else 1.0
            needed = max(min(needed, ramp.planned), slower)
        before = min(max(needed, 1.0), MOST_FACTOR)
        for number, (low, high) in enumerate(pairwise(levels), 1):
            if ramp.start < high and ramp.end > low:
                as_steep = math.log(high / low) / math.log(ramp.end / ramp.start)
                slowest[number] = max(slowest[number], min(before * as_steep, MOST_FACTOR))
    factors = tuple(float(f"{one:.2g}") if one > LEAST_FACTOR else 1.0 for one in slowest)
    return factors if any(factor > 1.0 for factor in factors) else ()
