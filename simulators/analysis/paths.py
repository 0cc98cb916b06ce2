"""From one periodic vibration to the next: prediction along the tangent, halved where Newton does not arrive."""

import math
from dataclasses import replace

from simulators.analysis.balance import Balance, Solution
from simulators.analysis.conditions import Conditions
from simulators.analysis.errors import NotConvergedError

__all__ = ["follow", "from_rest"]

_NEARLY_LINEAR = 1e-3
"""The first level is approached from this share of it, starting with the vibration of the linear rig."""
_RESONANCE_RAD = -0.5 * math.pi
_DEEPEST = 8
_LARGEST_LAG_STEP = 0.6
_LARGEST_LEVEL_RATIO = 4.0
"""Steps of the lag (rad) and of the level beyond which Newton may arrive at another vibration of the same conditions."""


def from_rest(balance: Balance, goal: Conditions, omega_rad_s: float) -> Solution:
    """The vibration at ``goal`` that a level raised from zero leads to; its lag or frequency is held meanwhile.

    It starts at ``omega_rad_s``: the frequency of the goal, or that of resonance, from which the lag is then turned. A
    response is raised at resonance and turned after: away from it takes more force, and there are more vibrations.
    """
    low = replace(goal, level=_NEARLY_LINEAR * goal.level)
    if goal.held == "response" and goal.at == "lag":
        low = replace(low, value=_RESONANCE_RAD)
    start = replace(low, value=_RESONANCE_RAD) if goal.at == "lag" else low
    here = balance.solve(balance.linear_start(start, omega_rad_s), start)
    here = follow(balance, here, low)
    return follow(balance, follow(balance, here, replace(low, level=goal.level)), goal)


def follow(balance: Balance, here: Solution, goal: Conditions, depth: int = 0) -> Solution:
    """The vibration at ``goal`` on the branch of ``here``; `NotConvergedError` where the branch does not reach it."""
    now = here.conditions
    if _far(now, goal):
        return follow(balance, follow(balance, here, now.halfway_to(goal)), goal)
    start = here.unknowns + here.tangent(level=goal.level / now.level - 1.0, value=goal.value - now.value)
    try:
        if min(start[-2:]) <= 0.0:
            raise NotConvergedError(f"no periodic vibration found at {goal}")
        return balance.solve(start, goal)
    except NotConvergedError:
        if depth == _DEEPEST:
            raise
    middle = follow(balance, here, now.halfway_to(goal), depth + 1)
    return follow(balance, middle, goal, depth + 1)


def _far(now: Conditions, goal: Conditions) -> bool:
    """Whether a step is to be halved before it is tried."""
    ratio = abs(math.log(goal.level / now.level))
    return ratio > math.log(_LARGEST_LEVEL_RATIO) or (
        goal.at == "lag" and abs(goal.value - now.value) > _LARGEST_LAG_STEP
    )
