"""Harmonic balance of the coupled rig, coil, armature and stinger included: an independent truth for tests.

The rig is driven by the pure voltage ``u = U cos(theta)`` in continuous time. Its linear part is solved exactly per
harmonic, the nonlinear sites by alternating frequency-time (Cameron & Griffin 1989) with ``samples`` per period;
friction carries its memory over two periods from the virgin state, the second of which counts. Where a site leaves the
range in which its law holds, the point is flagged. Of a rig that scatters it is the nominal specimen that is analysed;
``rig.realised(seed)`` is that of one run.

Lags are those of the drive point's acceleration behind the stinger force, fundamentals: -90 deg is phase resonance.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from simulators.analysis.balance import Balance, Conditions, Solution
from simulators.analysis.errors import NotConvergedError
from simulators.analysis.evaluation import Evaluation
from simulators.analysis.inputs import checked_harmonics, followed_mode, lags_rad, levels, positive
from simulators.analysis.paths import follow, from_rest
from simulators.analysis.responses import PeriodicResponses
from simulators.virtual_rig import VirtualRig

__all__ = ["constant_force_response", "forced_response", "phase_resonance_backbone"]

HARMONICS = 15
SAMPLES = 512
RESONANCE_DEG = -90.0
_FROM_BELOW_TO_ABOVE = (-175.0, -5.0)
_LAGS = 86


def phase_resonance_backbone(
    rig: VirtualRig,
    *,
    forces_n: ArrayLike | None = None,
    voltages_v: ArrayLike | None = None,
    phase_lag_deg: float = RESONANCE_DEG,
    excitation: Literal["exciter", "pure-sine"] = "exciter",
    near_hz: float | None = None,
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
) -> PeriodicResponses:
    """Vibrations at phase resonance, one per level, each followed from the one before.

    Parameters
    ----------
    rig
        The virtual rig.
    forces_n, voltages_v
        Levels: peaks of the fundamental of the stinger force (N), or amplitudes of the voltage (V); one of the two.
    phase_lag_deg
        Lag held, -179 to -1.
    excitation
        ``exciter``: the coupled rig under a pure voltage, whose force has harmonics. ``pure-sine``: the structure alone
        under a sinusoidal force at the drive point, given by ``forces_n``; a property of the structure, of no exciter.
    near_hz
        The linear mode of the structure nearest to this frequency is followed. Default: the lowest that moves a
        nonlinear site.
    harmonics, samples
        Highest harmonic, and samples per period (at least four per harmonic). ``neglected_share`` of the result says
        how much is left out; ask for more where that matters.

    Raises
    ------
    ValueError
        On values that are not allowed, by name.
    NotConvergedError
        Where a level is out of reach: says which; the points before it are in ``found``.
    """
    held, values = levels(forces_n, voltages_v)
    if excitation not in ("exciter", "pure-sine"):
        raise ValueError(f"excitation = {excitation!r}: allowed is exciter or pure-sine")
    if excitation == "pure-sine" and held != "force":
        raise ValueError("voltages_v: allowed with excitation = 'exciter', a pure sine has forces_n")
    lag = float(lags_rad("phase_lag_deg", [phase_lag_deg])[0])
    study = _Study.of(rig, near_hz, harmonics, samples, pure_sine=excitation == "pure-sine")
    goals = [Conditions(held, float(level), "lag", lag) for level in values]
    return study.evaluation(study.path(goals))


def constant_force_response(
    rig: VirtualRig,
    force_n: float,
    phase_lags_deg: ArrayLike | None = None,
    *,
    near_hz: float | None = None,
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
) -> PeriodicResponses:
    """Frequency response at constant fundamental force, from below to above resonance, unstable branch included.

    The phase lag is the path parameter: it grows along the whole curve, so that folds of the frequency need no arc
    length. ``stable`` tells the branches that a test with constant force and slowly swept frequency can hold (frequency
    grows with the lag) from those between the folds (it falls): static stability of the fundamental. Bifurcations to
    other periods, and the stability of a control loop, are not looked at.

    Parameters
    ----------
    rig
        The virtual rig.
    force_n
        Peak of the fundamental of the stinger force, held.
    phase_lags_deg
        Lags, -179 to -1, rising. Default: 86 from -175 to -5, both ends far off resonance.
    near_hz, harmonics, samples
        As for `phase_resonance_backbone`.

    Raises
    ------
    ValueError
        On values that are not allowed, by name.
    NotConvergedError
        Where the force is out of reach or the path ends: says where. ``found`` holds the points in between.
    """
    force = float(positive("force_n", [force_n])[0])
    asked = np.linspace(*_FROM_BELOW_TO_ABOVE, _LAGS) if phase_lags_deg is None else phase_lags_deg
    lags = lags_rad("phase_lags_deg", asked, rising=True)
    study = _Study.of(rig, near_hz, harmonics, samples)
    goals = [Conditions("force", force, "lag", float(lag)) for lag in lags]
    nearest = int(np.argmin(np.abs(lags - np.radians(RESONANCE_DEG))))
    above, failure = study.tried(goals[nearest:])
    if not above:
        raise NotConvergedError(str(failure))
    below, failed_below = study.tried(goals[:nearest][::-1], above[0])
    solutions = [*below[::-1], *above]
    slopes = np.array([solution.tangent(value=1.0)[-2] for solution in solutions])
    found = study.evaluation(solutions, stable=slopes > 0.0)
    if failure or failed_below:
        raise NotConvergedError("; ".join(str(one) for one in (failed_below, failure) if one), found)
    return found


def forced_response(
    rig: VirtualRig,
    voltage_v: float,
    frequencies_hz: ArrayLike,
    *,
    near_hz: float | None = None,
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
) -> PeriodicResponses:
    """Response to a constant voltage, frequency by frequency: what a slow uncontrolled sweep in that order sees.

    Each point is followed from the one before; where the branch ends, as a sweep would jump, from rest at that frequency.

    Parameters
    ----------
    rig
        The virtual rig.
    voltage_v
        Amplitude of the voltage.
    frequencies_hz
        Frequencies [n], in the order of the sweep.
    near_hz
        The linear mode that modal amplitude and damping refer to, as for `phase_resonance_backbone`.
    harmonics, samples
        As for `phase_resonance_backbone`.

    Raises
    ------
    ValueError
        On values that are not allowed, by name.
    NotConvergedError
        Where nothing is found at a frequency: says which; the points before it are in ``found``.
    """
    voltage = float(positive("voltage_v", [voltage_v])[0])
    omega = 2.0 * np.pi * positive("frequencies_hz", frequencies_hz)
    study = _Study.of(rig, near_hz, harmonics, samples)
    return study.evaluation(study.path([Conditions("voltage", voltage, "frequency", float(w)) for w in omega]))


@dataclass(frozen=True, eq=False)
class _Study:
    """One rig, its balance, and the linear mode that is followed."""

    balance: Balance
    evaluation: Evaluation
    resonance_rad_s: float

    @classmethod
    def of(
        cls, rig: VirtualRig, near_hz: float | None, harmonics: int, samples: int, *, pure_sine: bool = False
    ) -> "_Study":
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
