"""Backbones of structured models: vibrations at phase resonance, over the force.

The motion of the drive point lags the fundamental of the force by 90 degrees. For a sine this is the force that replaces what
damping loses, so that the vibration is that of a nonlinear mode but for the harmonics that damping has (Peeters, Kerschen and
Golinval, J. Sound Vib. 330, 2011). The frequency is one more unknown, and the phase one more equation.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.continuation.follow import continued
from identification.continuation.path import Steps
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.paths import beyond, sizes, statically_stable
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.states import SteadyStates, steady_states
from identification.models.structured.model import StructuredModel
from identification.models.structured.steady.balance import StructuredBalance
from identification.models.structured.steady.response import balance_of, resonance_hz
from identification.validation import positive
from vibrolock.arrays import Float

_FIRST_LEVEL = 0.02
_UNIT = 0.02
"""Unit of length of the frequency, relative to the first one."""


def structured_backbone(
    model: StructuredModel,
    force_n: float,
    *,
    force: Held = "pure-sine",
    exciter: Exciter | None = None,
    support: bool | None = None,
    near_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 300,
    largest_range_use: float = 3.0,
) -> SteadyStates:
    """Compute the vibrations at phase resonance from 2 % of a force up to this force, as `nonlinear_mode` measures them.

    Parameters
    ----------
    model
        Model of one force; at least one output is a motion.
    force_n
        Largest force, N: the peak of its fundamental, or its RMS if ``force`` is ``rms``.
    force, exciter, support
        As in `structured_response`, without ``voltage``.
    near_hz
        The backbone begins at the mode of small vibrations that is nearest; by default at that which moves most.
    harmonics, samples, points, largest_range_use
        As in `structured_response`.

    Raises
    ------
    IdentificationError
        If model, exciter and force do not match, if the mode has no phase resonance, or if the backbone ends before the
        force; the message says why.
    """
    if force == "voltage":
        raise IdentificationError(
            "force: is 'voltage', allowed are pure-sine, fundamental, rms: phase lags refer to the force"
        )
    balance = balance_of(model, force_n, force, exciter, support, harmonics, samples)
    found = resonances(model, balance, near_hz, largest_range_use, points)
    if found.reason:
        raise IdentificationError(f"force_n: the backbone ends at {found.level[-1] * force_n:.3g} N ({found.reason})")
    return found.states()


def resonances(
    model: StructuredModel,
    balance: StructuredBalance,
    near_hz: float | None,
    largest_range_use: float,
    points: int = 300,
) -> "Resonances":
    """Follow phase resonance from 2 % of the force that a balance holds up to this force, or as far as it goes."""
    begin_hz = resonance_hz(model, None if near_hz is None else positive("near_hz", near_hz, "Hz"))
    equations = _Resonance(balance, model.input_shapes[:, 0])
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

    equations: "_Resonance"
    unknowns: Float
    level: Float
    reason: str = ""

    @property
    def frequency_hz(self) -> Float:
        """float[n]."""
        return np.asarray(self.unknowns[:, -1])

    @property
    def balance(self) -> StructuredBalance:
        """Equations of the vibration."""
        return self.equations.balance

    def some(self, which: NDArray[np.int64]) -> "Resonances":
        """Return some of the points."""
        return replace(self, unknowns=self.unknowns[which], level=self.level[which])

    def like(self, model: StructuredModel) -> "Resonances":
        """Return the same points with the equations of another model, which they do not solve."""
        of = self.balance
        return replace(self, equations=_Resonance(of.like(model), model.input_shapes[:, 0]))

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


class _Resonance:
    """Equations of a vibration at phase resonance: unknowns are those of the balance and the frequency."""

    def __init__(self, balance: StructuredBalance, shape: Float) -> None:
        self.balance = balance
        row, across = np.zeros((2, balance.basis.size, balance.n_states))
        row[1] = shape  # of the displacement the part that is in phase with the force
        across[2] = shape
        own = np.zeros(balance.drive.size)
        self._row = np.concatenate([row.ravel(), own])
        self.amplitude_row = np.concatenate([across.ravel(), own, [0.0]])
        """Amplitude of the displacement at the drive point per unit of the unknowns."""

    def __call__(self, z: Float, level: float) -> tuple[Float, Float, Float]:
        """Return the residual and its derivatives by unknowns and level."""
        residual, by_z, by_hz, by_level = self.balance.evaluated(z[:-1], float(z[-1]), level)
        jacobian = np.zeros((z.size, z.size))
        jacobian[:-1, :-1], jacobian[:-1, -1], jacobian[-1, :-1] = by_z, by_hz, self._row
        return np.append(residual, self._row @ z[:-1]), jacobian, np.append(by_level, 0.0)
