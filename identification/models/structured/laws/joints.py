"""Joints: forces with memory, of sliders and of a hysteresis that bends."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from identification.models.structured.laws.law import FROM_ZERO, POSITIVE, Law, Transform, between
from vibrolock.arrays import Float
from vibrolock.iwan import iwan_sliders

_LARGEST_SLIP = 0.9
"""Largest slip x of a joint's sliders: one that the training data hardly reach is a spring to them, of any stiffness."""
_LARGEST_ELASTIC = 30.0
"""Largest force of a hysteresis that hardens, as the displacement x at which the stiffness at rest would reach it. Chosen, far
beyond the data: the bound of the motion needs one."""
_LEAST_EXPONENT = 0.75
"""Least exponent of a hysteresis. Chosen: below 1 the bend at zero force is a corner."""

_EXPONENT = Transform(
    lambda y: np.log(np.where(y >= _LEAST_EXPONENT, y, np.nan)),
    lambda v: np.maximum(np.exp(np.clip(v, -60.0, 60.0)), _LEAST_EXPONENT),
    f"numbers from {_LEAST_EXPONENT}",
    least=float(np.log(_LEAST_EXPONENT)),
    span=float(np.log(6.0)),
)
_RATIO = Transform(lambda y: y, lambda v: v, "finite numbers", span=10.0, size=2.0)
"""Its zero means nothing: what is not identified has an interval from softening, 1, to hardening, -1."""


class Joint(Law):
    """A force with memory: Jenkins sliders, or hystereses that bend, side by side.

    They stand beside the linear part, which is that of the structure with all sliders slipping.
    """

    sticks: ClassVar[bool] = True
    """Whether the joint sticks in small vibrations."""

    @abstractmethod
    def sliders(self) -> Float:
        """float[2, n]: stiffness (N per unit of x) and largest force (N) of each slider."""

    def bends(self) -> Float:
        """float[3, n]: yield force (N), exponent and ratio gamma of each hysteresis (`hysteresis`).

        Zeros for a slider; sliding force (N), -1 and Stribeck's speed (x per s; 0 for none) for dry friction.
        """
        return np.zeros((3, self.sliders().shape[1]))


@dataclass(frozen=True, eq=False)
class Jenkins(Joint):
    """One slider: a spring in series with dry friction."""

    kind = "jenkins"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.05, 0.1, 0.2, 0.4, 0.7)}

    stiffness_n: float = 1.0
    """Stiffness, N per unit of x."""
    slip: float = 0.5
    """Displacement x at which it slips."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        return np.array([[self.stiffness_n], [self.stiffness_n * self.slip]])


def _slips(count: int, largest: float = _LARGEST_SLIP) -> tuple[float, ...]:
    """Return slips that grow with the power 1.5 of their number."""
    return tuple((largest * (np.arange(1, count + 1) / count) ** 1.5).round(4).tolist())


@dataclass(frozen=True, eq=False)
class Masing(Joint):
    """Sliders that slip at given displacements, with free stiffnesses: any joint that follows Masing's rule, in steps.

    What slips beyond the training data is not seen there. Such a joint stays stuck in the model.
    """

    kind = "masing"
    free: ClassVar = {"stiffness_n": FROM_ZERO}
    linear = "stiffness_n"

    stiffness_n: tuple[float, ...] = (1.0,) * 18
    """Stiffness of each slider, N per unit of x, none below zero."""
    slips: tuple[float, ...] = _slips(18)
    """Displacements x at which they slip, growing with the power 1.5 of their number: close together where a joint slips
    little, and where most of its stiffness is. With equal ratios in their place, fits of the friction beam depended on the
    ratio."""

    @classmethod
    def spaced(cls, count: int, largest: float = _LARGEST_SLIP) -> Self:
        """Return a joint of ``count`` sliders with slips up to ``largest``."""
        return cls(stiffness_n=(1.0,) * count, slips=_slips(count, largest))

    def sliders(self) -> Float:
        """float[2, n]: stiffness and largest force."""
        return np.asarray(np.array(self.stiffness_n) * np.array([np.ones(len(self.slips)), self.slips]))


@dataclass(frozen=True, eq=False)
class Iwan(Joint):
    """Segalman's four-parameter Iwan joint (J. Appl. Mech. 72, 2005, 752), cut into sliders.

    Stiffness density over the displacement of slip ``R phi^chi`` up to ``slip``, and an end slider with ``beta`` times the
    stiffness of the density. In micro-slip the energy lost in a cycle grows with the amplitude to the power ``3 + chi``.
    """

    kind = "iwan"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE, "chi": between(-0.95, 2.0), "beta": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.3, 1.0, 3.0), "chi": (-0.5, 0.0, 0.5), "beta": (0.03, 0.3)}

    stiffness_n: float = 1.0
    """Stiffness while nothing slips, N per unit of x."""
    slip: float = 1.0
    """Displacement x at which all slips."""
    chi: float = 0.0
    """Exponent of the density."""
    beta: float = 0.1
    """Stiffness of the end slider over that of the density."""
    count: int = 20
    """Number of sliders of the density."""
    smallest: float = 0.0
    """Displacement below which nothing slips, over ``slip``, with slips above it in equal ratios. 0: slips grow with the square
    of their number. Most of the stiffness slips late, where equal ratios are coarse: fits of a joint of 40 sliders left four to
    nine times a noise of 0.1 % with 12 or 24 of them, and one to two with these 20."""

    def sliders(self) -> Float:
        """float[2, count + 1]: stiffness and largest force; exact in stuck stiffness and force at full slip."""
        edges = (np.arange(self.count + 1) / self.count) ** 2
        if self.smallest > 0.0:
            edges = np.concatenate([[0.0], np.geomspace(self.smallest, 1.0, self.count)])
        stiffness, slip = iwan_sliders(self.stiffness_n, self.chi, self.beta, edges)
        return np.array([stiffness, stiffness * self.slip * slip])


@dataclass(frozen=True, eq=False)
class BoucWen(Joint):
    """Hysteresis of Bouc and Wen: ``dr/dx = k [1 - (sgn(r dx) + gamma) |r/(k slip)|^exponent]``.

    These are all laws of Bouc and Wen that lose energy: with the usual ``dr/dx = k - (beta sgn(r dx) + gamma') |r|^n``,
    ``beta = k (k slip)^-n`` is above zero and ``gamma = gamma'/beta`` is free. Whatever its numbers, the law is passive from
    rest (`hysteresis`). From ``gamma`` -1 to 1 it is in class I of Ikhouane, Manosa and Rodellar (Systems and Control Letters
    56, 2007, 197), above 1 in class II; from -1 down it hardens. Its force is at most ``k slip (1 + gamma)^(-1/exponent)``,
    and at most 30 k, where it slips: there an element that hardens ends, far beyond the training data.
    """

    kind = "bouc-wen"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE, "exponent": _EXPONENT, "gamma": _RATIO}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.1, 0.3, 1.0, 3.0), "exponent": (1.0, 2.0), "gamma": (-1.5, 0.0, 0.8)}

    stiffness_n: float = 1.0
    """Stiffness at the turning of the force through zero, N per unit of x."""
    slip: float = 1.0
    """Displacement x with which the stiffness would reach the force at which bends are as large as the stiffness."""
    exponent: float = 1.0
    """Sharpness of the bend."""
    gamma: float = 0.0
    """Ratio of gamma to beta: bends in loading ``1 + gamma``, in unloading ``1 - gamma``."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        least = 1.0 + self.gamma
        softest = self.slip * least ** (-1.0 / self.exponent) if least > 0.0 else np.inf
        return self.stiffness_n * np.array([[1.0], [min(softest, _LARGEST_ELASTIC)]])

    def bends(self) -> Float:
        """float[3, 1]: yield force, exponent and ratio."""
        return np.array([[self.stiffness_n * self.slip], [self.exponent], [self.gamma]])
