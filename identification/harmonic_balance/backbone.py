"""Backbones: vibrations at phase resonance, over the force.

The motion of the drive point lags the fundamental of the force by 90 degrees. For a sine this is the force that replaces what
damping loses, so that the vibration is that of a nonlinear mode but for the harmonics that damping has (Peeters, Kerschen and
Golinval, J. Sound Vib. 330, 2011). The frequency is one more unknown, and the phase one more equation.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.continuation.follow import continued
from identification.continuation.path import Steps
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.paths import beyond, sizes, statically_stable
from identification.harmonic_balance.states import SteadyStates, steady_states
from vibrolock.arrays import Float

_FIRST_LEVEL = 0.02
"""Share of the force at which a backbone begins, near small vibrations. Chosen."""
_UNIT = 0.02
"""Unit of length of the frequency, relative to the first one."""


def resonances(balance: DrivenBalance, begin_hz: float, largest_range_use: float, points: int) -> "Resonances":
    """Follow phase resonance from 2 % of the force that a balance holds up to this force, or as far as it goes."""
    equations = PhaseResonance(balance)
    path = continued(
        equations,
        np.append(balance.linear(begin_hz, _FIRST_LEVEL), begin_hz),
        _FIRST_LEVEL,
        scale=np.append(sizes(balance, begin_hz), _UNIT * begin_hz),
        parameter_scale=0.5,
        lowest=0.5 * _FIRST_LEVEL,
        highest=1.0,
        points=points,
        steps=Steps(kinks=balance.kinks),
        stop=lambda z, level: beyond(balance, z[:-1], largest_range_use),
    )
    complete = path.ending == "range" and path.parameter[-1] == 1.0
    return Resonances(equations, path.unknowns, path.parameter, "" if complete else path.reason or path.ending)


@dataclass(frozen=True, eq=False)
class Resonances:
    """Vibrations at phase resonance, over the level of the force.

    Parameters
    ----------
    equations
        Equations that they solve.
    unknowns
        float[n, n_unknowns], those of the balance, then the frequency, Hz.
    level
        float[n], force over that which the balance holds.
    reason
        Why they end below the level 1; empty if they do not.
    """

    equations: "PhaseResonance"
    unknowns: Float
    level: Float
    reason: str = ""

    @property
    def frequency_hz(self) -> Float:
        """float[n]."""
        return np.asarray(self.unknowns[:, -1])

    @property
    def balance(self) -> DrivenBalance:
        """Equations of the vibration."""
        return self.equations.balance

    def some(self, which: NDArray[np.int64]) -> "Resonances":
        """Return some of the points."""
        return replace(self, unknowns=self.unknowns[which], level=self.level[which])

    def like(self, balance: DrivenBalance) -> "Resonances":
        """Return the same points with other equations, which they do not solve."""
        return replace(self, equations=PhaseResonance(balance))

    def use(self) -> Float:
        """float[n]: largest displacement of any element over its range."""
        return np.array([np.max(self.balance.state_use(z[:-1], self.balance.basis.to_time)) for z in self.unknowns])

    def states(self) -> SteadyStates:
        """Return the vibrations with their stability."""
        balance, unknowns, at_hz = self.balance, self.unknowns[:, :-1], self.frequency_hz
        stable = [
            statically_stable(balance, z, hz, of)
            for z, hz, of in zip(unknowns, at_hz.tolist(), self.level, strict=True)
        ]
        return steady_states(balance, unknowns, at_hz, np.array(stable), self.level)


class PhaseResonance:
    """Equations of a vibration at phase resonance: unknowns are those of the balance and the frequency."""

    def __init__(self, balance: DrivenBalance) -> None:
        self.balance = balance

    def __call__(self, z: Float, level: float) -> tuple[Float, Float, Float]:
        """Return the residual and its derivatives by unknowns and level."""
        residual, by_z, by_hz, by_level = self.balance.evaluated(z[:-1], float(z[-1]), level)
        phase, phase_by_z, phase_by_hz, phase_by_level = self.balance.in_phase(z[:-1], float(z[-1]), level)
        jacobian = np.zeros((z.size, z.size))
        jacobian[:-1, :-1], jacobian[:-1, -1] = by_z, by_hz
        jacobian[-1, :-1], jacobian[-1, -1] = phase_by_z, phase_by_hz
        return np.append(residual, phase), jacobian, np.append(by_level, phase_by_level)
