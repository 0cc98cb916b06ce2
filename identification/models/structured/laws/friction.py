"""Dry friction, the same at all speeds or larger at rest."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from identification.models.structured.laws.joints import Joint
from identification.models.structured.laws.law import POSITIVE
from vibrolock.arrays import Float

_CREEP = 1e-8
"""Displacement x by which a step of dry friction creeps if it just holds. Chosen: little over all steps of a record, far above
rounding."""


@dataclass(frozen=True, eq=False)
class Coulomb(Joint):
    """Dry friction: a force of one size against the motion, and any smaller one at rest.

    The step of the simulation makes it a number: over a step it is the whole force against the mean velocity, or, if the
    element would turn round, what holds it. A step that holds may creep by a hundred-millionth of the largest displacement in
    the training data; what a model does, does not depend on it. Harmonic balance has no steps: there dry friction slips at a
    thousandth. In small vibrations it slips: those of the linear part are of a modal test of which friction takes little.
    """

    kind = "coulomb"
    free: ClassVar = {"friction_n": POSITIVE}
    linear = "friction_n"
    sticks = False

    friction_n: float = 1.0
    """Friction force, N."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        return np.array([[self.friction_n / _CREEP], [self.friction_n]])

    def bends(self) -> Float:
        """float[3, 1]: an exponent of -1 for dry friction."""
        return np.array([[0.0], [-1.0], [0.0]])


@dataclass(frozen=True, eq=False)
class Stribeck(Joint):
    """Dry friction that is larger at rest: ``R (1 + rise exp(-(w/speed_per_s)^2))`` at the speed w, by Stribeck's law.

    Otherwise as `Coulomb`. It is passive whatever its numbers are. The form is that of Bo and Pavelescu (Wear 82, 1982, 277)
    with the exponent 2. Regressions, which know displacements alone, and the range use take the friction at rest.
    """

    kind = "stribeck"
    free: ClassVar = {"friction_n": POSITIVE, "rise": POSITIVE, "speed_per_s": POSITIVE}
    linear = "friction_n"
    sticks = False

    friction_n: float = 1.0
    """Friction force far above Stribeck's speed, N."""
    rise: float = 0.5
    """What it is more at rest, over that."""
    speed_per_s: float = 20.0
    """Stribeck's speed, x per s."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        at_rest = self.friction_n * (1.0 + self.rise)
        return np.array([[at_rest / _CREEP], [at_rest]])

    def bends(self) -> Float:
        """float[3, 1]: sliding force, an exponent of -1 for dry friction, and Stribeck's speed."""
        return np.array([[self.friction_n], [-1.0], [self.speed_per_s]])
