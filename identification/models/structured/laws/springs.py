"""Springs: forces without memory that depend on the displacement."""

import importlib
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from identification.errors import IdentificationError
from identification.models.structured.laws.law import PLAIN, POSITIVE, Law
from vibrolock.arrays import Float

_MAGNET_REACH = 0.8
"""Share of a magnet's gap beyond which its force goes on as a straight line."""


class Spring(Law):
    """A force without memory that depends on the displacement."""

    @abstractmethod
    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""


@dataclass(frozen=True, eq=False)
class PolynomialSpring(Spring):
    """``sum_k c_k x^(k+2)``."""

    kind = "polynomial-spring"
    free: ClassVar = {"coefficients_n": PLAIN}
    linear = "coefficients_n"

    coefficients_n: tuple[float, ...] = (0.0,) * 5
    """Coefficients of the square, the cube, ..., N."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        return np.asarray(np.polynomial.polynomial.polyval(x, [0.0, 0.0, *self.coefficients_n]))


@dataclass(frozen=True, eq=False)
class SplineSpring(Spring):
    """A cubic spline, given by its second derivative at knots; force and slope are zero at rest."""

    kind = "spline-spring"
    free: ClassVar = {"curvatures_n": PLAIN}
    linear = "curvatures_n"

    curvatures_n: tuple[float, ...] = (0.0,) * 7
    """Second derivative by x at the knots, N."""
    knots: tuple[float, ...] = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
    """Displacements x, rising. Beyond the first and the last one the curvature stays."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        from scipy.interpolate import make_interp_spline  # only on use: it takes long to load

        far = 10.0 * max(map(abs, self.knots))
        knots = np.array([-far, *self.knots, far])
        curvatures = np.array([self.curvatures_n[0], *self.curvatures_n, self.curvatures_n[-1]])
        slope = make_interp_spline(knots, curvatures, k=1).antiderivative()
        integral = slope.antiderivative()
        return np.asarray(integral(x) - integral(0.0) - slope(0.0) * x)


@dataclass(frozen=True, eq=False)
class Stop(Spring):
    """An elastic stop beyond a gap, on one side or on both: ``k (x - gap)``."""

    kind = "stop"
    free: ClassVar = {"stiffness_n": POSITIVE, "gap": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"gap": (0.1, 0.2, 0.35, 0.5, 0.65, 0.8)}

    stiffness_n: float = 1.0
    """Stiffness of the contact, N per unit of x."""
    gap: float = 0.5
    """Displacement x at which contact begins."""
    sides: str = "above"
    """``above``, ``below`` or ``both``."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        above = np.maximum(x - self.gap, 0.0) if self.sides != "below" else 0.0
        below = np.minimum(x + self.gap, 0.0) if self.sides != "above" else 0.0
        return np.asarray(self.stiffness_n * (above + below))


@dataclass(frozen=True, eq=False)
class MagnetSpring(Spring):
    """A magnet that faces another one: ``a ((1 - x/gap)^-4 - 1 - 4 x/gap)``, without its linear part.

    Beyond 0.8 of the gap the force goes on as a straight line. A positive gap lies above, a negative one below.
    """

    kind = "magnet"
    free: ClassVar = {"strength_n": PLAIN, "gap": PLAIN}
    linear = "strength_n"
    tried: ClassVar = {"gap": (-8.0, -4.0, -2.0, -1.4, 1.4, 2.0, 4.0, 8.0)}

    strength_n: float = 0.1
    """Force a between the magnets at rest, N; above zero they repel each other."""
    gap: float = 4.0
    """Gap at rest, in units of x."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        share = x / self.gap
        near = np.minimum(share, _MAGNET_REACH)
        open_ = 1.0 - near
        along = open_**-4.0 + 4.0 * open_**-5.0 * (share - near)
        return np.asarray(np.sign(self.gap) * self.strength_n * (along - 1.0 - 4.0 * share))


@dataclass(frozen=True, eq=False)
class UserSpring(Spring):
    """A function of the user's own, ``function(x, numbers)``, of arrays."""

    kind = "user-spring"
    free: ClassVar = {"numbers": PLAIN}

    function: str
    """``"module:name"``."""
    numbers: tuple[float, ...]
    """What the function is given, and what a fit moves."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        module, _, name = self.function.partition(":")
        try:
            function = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError, ValueError) as error:
            raise IdentificationError(
                f"user-spring: function is '{self.function}', allowed is 'module:name' of one that can be imported ({error})"
            ) from None
        found = np.asarray(function(x, np.array(self.numbers)), dtype=np.float64)
        if found.shape != np.shape(x) or not np.all(np.isfinite(found)):
            raise IdentificationError(
                f"user-spring: '{self.function}' gives {found.shape} values, allowed are finite ones, one for each x"
            )
        return found
