"""Dampers: dampings that depend on the displacement."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from identification.models.structured.laws.law import FROM_ZERO, Law
from vibrolock.arrays import Float


class Damper(Law):
    """A damping that depends on the displacement."""

    @abstractmethod
    def damping(self, x: Float) -> Float:
        """Return the damping at ``x``, N s/m, nowhere below zero."""


@dataclass(frozen=True, eq=False)
class PolynomialDamper(Damper):
    """``sum_j c_j |x|^(j+1)``."""

    kind = "polynomial-damper"
    free: ClassVar = {"coefficients_n_s_m": FROM_ZERO}
    linear = "coefficients_n_s_m"

    coefficients_n_s_m: tuple[float, ...] = (0.0, 0.0)
    """Coefficients of the size, its square, ..., N s/m, none below zero."""

    def damping(self, x: Float) -> Float:
        """Return the damping at ``x``, N s/m."""
        return np.asarray(np.polynomial.polynomial.polyval(np.abs(x), [0.0, *self.coefficients_n_s_m]))
