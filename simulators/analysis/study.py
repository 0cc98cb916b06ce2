"""Paths of periodic vibrations of one rig: what all analyses by harmonic balance share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from simulators.analysis.balance import Balance, Solution
from simulators.analysis.conditions import Conditions
from simulators.analysis.errors import NotConvergedError
from simulators.analysis.evaluation import Evaluation
from simulators.analysis.inputs import checked_harmonics, followed_mode
from simulators.analysis.paths import follow, from_rest
from simulators.analysis.responses import PeriodicResponses
from simulators.virtual_rig import VirtualRig

__all__ = ["HARMONICS", "SAMPLES", "Study"]

HARMONICS = 15
SAMPLES = 512
_RESONANCE_RAD = -0.5 * np.pi


@dataclass(frozen=True, eq=False)
class Study:
    """One rig, its balance, and the linear mode that is followed."""

    balance: Balance
    evaluation: Evaluation
    resonance_rad_s: float

    @classmethod
    def of(
        cls, rig: VirtualRig, near_hz: float | None, harmonics: int, samples: int, *, pure_sine: bool = False
    ) -> "Study":
        """Study of the mode nearest to ``near_hz``; its arguments are checked."""
        balance = Balance(rig, *checked_harmonics(harmonics, samples), pure_sine=pure_sine)
        mode = followed_mode(rig, near_hz)
        resonance = 2.0 * np.pi * float(rig.linear_modes.frequency_hz[mode])
        return cls(balance, Evaluation(rig, balance, mode), resonance)

    def path(self, goals: Sequence[Conditions]) -> list[Solution]:
        """One vibration per goal; `NotConvergedError` with those found before."""
        solutions, failure = self.tried(goals)
        if failure is not None:
            raise NotConvergedError(str(failure), self.evaluation(solutions) if solutions else None) from failure
        return solutions

    def over_lags(self, goals: Sequence[Conditions]) -> PeriodicResponses:
        """One vibration per goal, goals of one level at rising lags: both ways from the one nearest to resonance."""
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
        """Vibrations until the first that is not found, and why."""
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
