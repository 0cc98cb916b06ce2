"""Solutions of a harmonic balance: one at a given frequency from rest, all along a band, and those at phase resonance.

At phase resonance the motion of the drive point lags the fundamental of the force by 90 degrees. For a sine this is the force
that replaces what damping loses, so that the vibration is that of a nonlinear mode but for the harmonics that damping has
(Peeters, Kerschen and Golinval, J. Sound Vib. 330, 2011). The frequency is one more unknown, and the phase one more equation.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.continuation.follow import continued
from identification.continuation.newton import solved
from identification.continuation.path import Path, Steps
from identification.errors import IdentificationError
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.states import SteadyStates, steady_states
from vibrolock.arrays import Float

_FIRST_LEVEL = 0.02
"""Share of the level at which Newton's method starts from the linear solution, and a backbone begins. Chosen."""
_FURTHER_LEVELS = (2e-3, 2e-4, 2e-5)
"""Shares at which a backbone begins where Newton's method fails there: fewer sliders of a joint slip, at last none. Chosen."""
_SAME_MODE = 0.1
"""Relative change of frequency from the linear vibration to the first one of a backbone, if it is of the same mode. Chosen."""
_LEVELS = Steps(first=0.1, largest=0.5)
"""Steps along the level, in units of half of it. Chosen."""
_MOST_LEVELS = 300
"""Points on the way from rest, at most. Chosen."""
_STEPS = Steps(first=0.2 * 0.05, largest=0.05, smallest=1e-5 * 0.05)
"""Steps along a band. Chosen."""
_UNIT = 0.02
"""Unit of length of the frequency, relative to the first one. Chosen."""
_BAND_UNITS = 4.0
"""Length of a band in units of the path: with the longest step of 0.05 a band takes 80 points, with a resonance many more."""


class Followed(NamedTuple):
    """A path and a note on its end; the note is empty if the path reached the far end of the band."""

    path: Path
    note: str

    def states(self, balance: DrivenBalance, *, stability: bool = True) -> SteadyStates:
        """Return the vibrations along the path."""
        path = self.path
        rising = path.direction * path.direction[0] > 0.0
        return steady_states(balance, path.unknowns, path.parameter, rising, stability=stability)

    def folds(self, balance: DrivenBalance, *, stability: bool = True) -> SteadyStates:
        """Return the vibrations at which the frequency turns back."""
        path = self.path
        none = np.zeros(path.turning_parameter.size, dtype=bool)
        return steady_states(balance, path.turning_unknowns, path.turning_parameter, none, stability=stability)


def sizes(balance: DrivenBalance, frequency_hz: float) -> Float:
    """Size of each unknown in the linear solution at this frequency, the same for all harmonics."""
    linear = balance.linear(frequency_hz)
    states = np.max(np.abs(balance.states(linear)), axis=0)
    states = np.maximum(states, 1e-9 * np.max(states, initial=1e-300))
    own = balance.own(linear)
    if own.size > 2:  # the harmonics of a force, and the two parts of a voltage
        own = np.concatenate([np.full(own.size - 2, np.linalg.norm(own[:2])), np.full(2, np.linalg.norm(own[-2:]))])
    return np.concatenate([np.tile(states, balance.basis.size), np.abs(own)])


def from_rest(balance: DrivenBalance, frequency_hz: float, largest_use: float = np.inf) -> Float | None:
    """Return the unknowns of the vibration reached from rest as the level rises; None if the path does not reach the level."""
    linear, scale = balance.linear(frequency_hz, _FIRST_LEVEL), sizes(balance, frequency_hz)
    try:
        path = continued(
            balance.over_level(frequency_hz),
            linear,
            _FIRST_LEVEL,
            scale=scale,
            parameter_scale=0.5,
            lowest=0.5 * _FIRST_LEVEL,
            highest=1.0,
            points=_MOST_LEVELS,
            steps=replace(_LEVELS, kinks=balance.kinks),
            stop=lambda z, level: beyond(balance, z, largest_use),
        )
    except IdentificationError:
        return None
    return path.unknowns[-1] if path.ending == "range" and path.parameter[-1] == 1.0 else None


def statically_stable(balance: DrivenBalance, z: Float, frequency_hz: float, level: float = 1.0) -> bool:
    """Return whether a vibration is stable under slow changes: the determinant of its Jacobian has the same sign as at rest."""
    rest = balance.linear(frequency_hz, _FIRST_LEVEL**2)
    signs = [
        np.linalg.slogdet(balance.evaluated(at, frequency_hz, of)[1])[0]
        for at, of in ((z, level), (rest, _FIRST_LEVEL**2))
    ]
    return bool(signs[0] == signs[1])


def followed(
    balance: DrivenBalance, begin_hz: float, end_hz: float, *, points: int, largest_use: float
) -> Followed | None:
    """Follow the response from rest at one end of a band to the other end; return None if no start is found."""
    start = from_rest(balance, begin_hz, largest_use)
    if start is None:
        return None
    low, high = sorted((begin_hz, end_hz))
    path = continued(
        balance.over_frequency(),
        start,
        begin_hz,
        scale=sizes(balance, begin_hz),
        parameter_scale=(high - low) / _BAND_UNITS,
        direction=end_hz - begin_hz,
        lowest=low,
        highest=high,
        points=points,
        steps=replace(_STEPS, kinks=balance.kinks),
        stop=lambda z, frequency_hz: beyond(balance, z, largest_use),
    )
    return Followed(path, _note(path, begin_hz, end_hz))


def polished(balance: DrivenBalance, z: Float, frequency_hz: float) -> Float | None:
    """Return the solution near ``z`` at a frequency; None if there is none."""
    return solved(balance.over_frequency(), z, frequency_hz, scale=sizes(balance, frequency_hz))


def beyond(balance: DrivenBalance, z: Float, largest_use: float) -> str:
    """Return a message if states are far outside the range of the training data; else an empty text."""
    use = balance.state_use(z, balance.basis.to_time)
    return balance.beyond.format(largest_use) if np.any(use > largest_use) else ""


def _note(path: Path, begin_hz: float, end_hz: float) -> str:
    where = f"{path.parameter[-1]:.4g} Hz"
    if path.ending == "range":
        reached = path.parameter[-1] == end_hz
        return "" if reached else f"the response from {begin_hz:.4g} Hz turned back and left the band where it began"
    why = {
        "stopped": path.reason,
        "points": "it has all points that it may have",
        "closed": "it closed on itself",
        "step": "no solution was found farther on",
    }[path.ending]
    return f"the response from {begin_hz:.4g} Hz ends at {where}: {why}"


def resonances(balance: DrivenBalance, begin_hz: float, largest_range_use: float, points: int) -> "Resonances":
    """Follow phase resonance from 2 % of the force that a balance holds up to this force, or as far as it goes.

    It begins at less where Newton's method finds no vibration from the linear one, or another than that of the mode, such as
    that of an antiresonance, which has the same phase.
    """
    equations, scale = PhaseResonance(balance), np.append(sizes(balance, begin_hz), _UNIT * begin_hz)

    def linear(level: float) -> Float:
        return np.append(balance.linear(begin_hz, level), begin_hz)

    def is_of_the_mode(level: float) -> bool:
        z = solved(equations, linear(level), level, scale=scale)
        return z is not None and abs(float(z[-1]) / begin_hz - 1.0) < _SAME_MODE

    first = next((level for level in (_FIRST_LEVEL, *_FURTHER_LEVELS) if is_of_the_mode(level)), _FIRST_LEVEL)
    path = continued(
        equations,
        linear(first),
        first,
        scale=scale,
        parameter_scale=0.5,
        lowest=0.5 * first,
        highest=1.0,
        points=points,
        steps=Steps(kinks=balance.kinks),
        stop=lambda z, level: beyond(balance, z[:-1], largest_range_use),
    )
    complete = path.ending == "range" and path.parameter[-1] == 1.0
    return Resonances(equations, path.unknowns, path.parameter, "" if complete else path.reason or path.ending)


@dataclass(frozen=True, eq=False)
class Resonances:
    """Vibrations at phase resonance, over the level of the force."""

    equations: "PhaseResonance"
    """Equations that they solve."""
    unknowns: Float
    """float[n, n_unknowns], those of the balance, then the frequency, Hz."""
    level: Float
    """float[n], force over that which the balance holds."""
    reason: str = ""
    """Why they end below the level 1; empty if they do not."""

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

    def states(self, *, stability: bool = True) -> SteadyStates:
        """Return the vibrations; without ``stability`` all count as stable."""
        balance, unknowns, at_hz = self.balance, self.unknowns[:, :-1], self.frequency_hz
        stable = [
            not stability or statically_stable(balance, z, hz, of)
            for z, hz, of in zip(unknowns, at_hz.tolist(), self.level, strict=True)
        ]
        return steady_states(balance, unknowns, at_hz, np.array(stable), self.level, stability=stability)


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
