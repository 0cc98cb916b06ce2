"""Nonlinear elements of a structured model: a spring and a damper along a direction in the space of the modes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive

__all__ = ["NonlinearElement"]

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearElement:
    """A nonlinear spring with a damper beside it.

    With the element's displacement ``z = direction . q`` relative to its scale, ``x = z / scale_m``, the force on the element
    is ``sum_k spring_n[k] x^(k+2) + (sum_j damper_n_s_m[j] |x|^(j+1)) dz/dt``. The linear part of spring and damper belongs to
    the modes. Beyond ``|x| = reach`` the damping is constant, and the spring goes on as a straight line with the slope that it
    has there, but at least minus half of the structure's static stiffness in this direction (divided by the number of
    elements): the potential energy is bounded below in every direction.

    Parameters
    ----------
    direction
        float[n_modes], displacement of the element per modal coordinate, kg^-1/2.
    scale_m
        Displacement for which x is 1.
    spring_n
        float[...], coefficients of ``x^2``, ``x^3``, ..., N.
    damper_n_s_m
        float[...], coefficients of ``|x|``, ``|x|^2``, ..., N s/m, none below zero.
    reach
        Largest ``|x|`` of the polynomials.

    Raises
    ------
    IdentificationError
        If a number is not finite, a damping is below zero, or scale or reach are not above zero.
    """

    direction: Float
    scale_m: float
    spring_n: Float
    damper_n_s_m: Float
    reach: float = 3.0

    def __post_init__(self) -> None:
        for name in ("direction", "spring_n", "damper_n_s_m"):
            object.__setattr__(self, name, finite_array(f"element: {name}", getattr(self, name), np.float64, 1))
        for name in ("scale_m", "reach"):
            object.__setattr__(self, name, positive(f"element: {name}", getattr(self, name)))
        if np.any(self.damper_n_s_m < 0.0):
            raise IdentificationError(
                f"element: damper_n_s_m is {self.damper_n_s_m.tolist()}, allowed are numbers from 0: it must not do work"
            )

    @property
    def phi(self) -> Float:
        """float[n_modes]: x per modal coordinate, kg^-1/2 m^-1."""
        return np.asarray(self.direction / self.scale_m)

    @property
    def law(self) -> Float:
        """float[...]: coefficients of spring and damper as functions of x, J and J s."""
        return np.concatenate([self.spring_n * self.scale_m, self.damper_n_s_m * self.scale_m**2])
