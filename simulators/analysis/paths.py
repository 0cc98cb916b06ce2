"""Paths of periodic vibrations of one rig: predict along the tangent, and halve steps where Newton's method fails."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from simulators.analysis.balance import Balance, Solution
from simulators.analysis.conditions import Conditions, checked_harmonics, followed_mode
from simulators.analysis.evaluation import Evaluation
from simulators.analysis.force_control import ForceControl, ForceHarmonics
from simulators.analysis.responses import NotConvergedError, PeriodicResponses
from simulators.virtual_rig import VirtualRig

_RESONANCE_RAD = -0.5 * math.pi  # rad; lag of the acceleration behind the force at phase resonance
_NEARLY_LINEAR = 1e-3
"""Share of the first level at which a path starts, from the vibration of the linear rig."""
_DEEPEST = 8  # most times in a row that a failing step is halved; chosen
_LARGEST_LAG_STEP = 0.6  # rad; chosen, see below
_LARGEST_LEVEL_RATIO = 4.0
"""Largest steps of the lag (rad) and the level; beyond, Newton may converge to another vibration of the same conditions."""


def from_rest(balance: Balance, goal: Conditions, omega_rad_s: float) -> Solution:
    """Return the vibration at ``goal`` that is reached from rest by raising the level at constant lag or frequency.

    The path starts at ``omega_rad_s``: the frequency of the goal or, if a lag is held, the resonance frequency, from which the
    lag is then changed. With a held response the level is raised at resonance and the lag is changed afterwards, because away
    from resonance the response needs more force and several vibrations may exist.
    """
    low = replace(goal, level=_NEARLY_LINEAR * goal.level)
    if goal.held == "response" and goal.at == "lag":
        low = replace(low, value=_RESONANCE_RAD)
    start = replace(low, value=_RESONANCE_RAD) if goal.at == "lag" else low
    here = balance.solve(balance.linear_start(start, omega_rad_s), start)
    here = follow(balance, here, low)
    return follow(balance, follow(balance, here, replace(low, level=goal.level)), goal)


def follow(balance: Balance, here: Solution, goal: Conditions, depth: int = 0) -> Solution:
    """Return the vibration at ``goal`` on the branch of ``here``; raise `NotConvergedError` if the branch does not reach it."""
    now = here.conditions
    turn = abs(goal.value - now.value) if goal.at == "lag" else 0.0
    if abs(math.log(goal.level / now.level)) > math.log(_LARGEST_LEVEL_RATIO) or turn > _LARGEST_LAG_STEP:
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


class BalanceOptions(TypedDict, total=False):
    """Options of all responses by harmonic balance."""

    force_harmonics: ForceHarmonics | None
    """Harmonics of the stinger force that are controlled; by default none, and the voltage is a sine."""
    near_hz: float | None
    """Frequency near the linear mode that is followed, and to which modal amplitude and damping refer."""
    harmonics: int
    """Highest harmonic, by default 15."""
    samples: int
    """Samples per period, at least four per harmonic; by default 512."""


@dataclass(frozen=True, eq=False)
class ModePaths:
    """Paths of periodic vibrations that belong to one linear mode of a rig."""

    balance: Balance
    evaluation: Evaluation
    resonance_rad_s: float

    @classmethod
    def of(
        cls,
        rig: VirtualRig,
        *,
        near_hz: float | None = None,
        harmonics: int = 15,
        samples: int = 512,
        force_harmonics: ForceHarmonics | None = None,
        pure_sine: bool = False,
    ) -> "ModePaths":
        """Return the paths of the mode nearest to ``near_hz``, after a check of the arguments."""
        checked = checked_harmonics(harmonics, samples)
        control = ForceControl.of(force_harmonics, harmonics)
        balance = Balance(rig, *checked, pure_sine=pure_sine, control=control)
        mode = followed_mode(rig, near_hz)
        resonance = 2.0 * np.pi * float(rig.linear_modes.frequency_hz[mode])
        return cls(balance, Evaluation(rig, balance, mode), resonance)

    def path(self, goals: Sequence[Conditions]) -> list[Solution]:
        """Return one vibration per goal; raise `NotConvergedError` with the vibrations found before a failure."""
        solutions, failure = self.tried(goals)
        if failure is not None:
            raise NotConvergedError(str(failure), self.evaluation(solutions) if solutions else None) from failure
        return solutions

    def over_lags(self, goals: Sequence[Conditions]) -> PeriodicResponses:
        """Return one vibration per goal (one level, rising lags), followed both ways from the goal nearest to resonance."""
        nearest = int(np.argmin([abs(goal.value - _RESONANCE_RAD) for goal in goals]))
        above, failure = self.tried(goals[nearest:])
        if not above:
            raise NotConvergedError(str(failure))
        below, failed_below = self.tried(goals[:nearest][::-1], above[0])
        found = self.evaluation([*below[::-1], *above])
        if failure or failed_below:
            raise NotConvergedError("; ".join(str(one) for one in (failed_below, failure) if one), found)
        return found

    def tried(
        self, goals: Iterable[Conditions], here: Solution | None = None
    ) -> tuple[list[Solution], NotConvergedError | None]:
        """Return the vibrations up to the first goal that fails, and the error of that goal or None."""
        solutions: list[Solution] = []
        for goal in goals:
            try:
                here = self._next(here, goal)
            except NotConvergedError as failure:
                asked, ended = str(goal), str(failure)
                return solutions, failure if asked in ended else NotConvergedError(f"{asked}: {ended}")
            solutions.append(here)
        return solutions, None

    def _next(self, here: Solution | None, goal: Conditions) -> Solution:
        if here is not None:
            try:
                return follow(self.balance, here, goal)
            except NotConvergedError:
                if goal.at == "lag":
                    raise
        return from_rest(self.balance, goal, goal.value if goal.at == "frequency" else self.resonance_rad_s)
