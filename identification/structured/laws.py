"""Compiled laws of nonlinear elements: a polynomial spring and a damper, over a displacement without unit."""

import math

import numpy as np

from vibrolock.compiled import inner_kernel

__all__ = ["damping_basis", "damping_of", "element_basis", "element_force", "spring_basis", "spring_of"]

NEAR = 1e-3  # of the reach: over shorter ways the mean force is that of two Gauss points, which is exact to rounding
GAUSS = 0.5 - 0.5 / math.sqrt(3.0)


@inner_kernel
def polynomial(x: float, law: np.ndarray, springs: int) -> tuple[float, float]:
    """Return ``sum_k a_k x^(k+2)`` and its slope."""
    value, slope = 0.0, 0.0
    for k in range(springs - 1, -1, -1):
        slope = slope * x + value
        value = value * x + law[k]
    return x * x * value, 2.0 * x * value + x * x * slope


@inner_kernel
def spring_of(x: float, law: np.ndarray, springs: int, reach: float, softest: float) -> tuple[float, float, float]:
    """Return force, slope and potential at ``x``: a polynomial up to +-``reach``, a line beyond it.

    The slope of the line is that of the polynomial at its end, at least ``softest``.
    """
    inside = min(max(x, -reach), reach)
    force, slope = polynomial(inside, law, springs)
    potential = 0.0
    for k in range(springs - 1, -1, -1):
        potential = potential * inside + law[k] / (k + 3)
    potential *= inside * inside * inside
    beyond = x - inside
    if beyond != 0.0:
        slope = max(slope, softest)
        potential += beyond * (force + 0.5 * slope * beyond)
        force += slope * beyond
    return force, slope, potential


@inner_kernel
def spring_basis(x: float, k: int, law: np.ndarray, springs: int, reach: float, softest: float) -> tuple[float, float]:
    """Return derivatives of force and potential at ``x`` by the coefficient ``k``."""
    inside = min(max(x, -reach), reach)
    beyond = x - inside
    force, potential = inside ** (k + 2), inside ** (k + 3) / (k + 3)
    if beyond != 0.0:
        slope = (k + 2) * inside ** (k + 1)
        if polynomial(inside, law, springs)[1] < softest:
            slope = 0.0
        potential += beyond * (force + 0.5 * slope * beyond)
        force += slope * beyond
    return force, potential


@inner_kernel
def damping_of(x: float, law: np.ndarray, springs: int, reach: float) -> tuple[float, float]:
    """Return the damping ``sum_j g_j |x|^(j+1)`` and its slope by x, constant beyond the reach."""
    size = min(abs(x), reach)
    value, slope = 0.0, 0.0
    for j in range(law.size - springs - 1, -1, -1):
        slope = slope * size + value
        value = value * size + law[springs + j]
    slope = value + size * slope
    if abs(x) > reach:
        slope = 0.0
    return size * value, math.copysign(slope, x)


@inner_kernel
def damping_basis(x: float, j: int, reach: float) -> float:
    """Return the derivative of the damping at ``x`` by its coefficient ``j``."""
    return float(min(abs(x), reach) ** (j + 1))


@inner_kernel
def element_force(
    z: float, w: float, h: float, law: np.ndarray, springs: int, reach: float, softest: float
) -> tuple[float, float, float]:
    """Return the mean force over a step, and its derivatives by ``z`` and by ``w``."""
    end = z + h * w
    middle = z + 0.5 * h * w
    if abs(end - z) > NEAR * reach:
        first, _, before = spring_of(z, law, springs, reach, softest)
        last, _, after = spring_of(end, law, springs, reach, softest)
        mean = (after - before) / (end - z)
        by_z = (last - first) / (end - z)
        by_end = (last - mean) / (end - z)
    else:
        first, steep_first, _ = spring_of(z + GAUSS * (end - z), law, springs, reach, softest)
        last, steep_last, _ = spring_of(end - GAUSS * (end - z), law, springs, reach, softest)
        mean, by_z = 0.5 * (first + last), 0.5 * (steep_first + steep_last)
        by_end = 0.5 * (GAUSS * steep_first + (1.0 - GAUSS) * steep_last)
    damping, steep = damping_of(middle, law, springs, reach)
    return mean + damping * w, by_z + steep * w, h * by_end + damping + 0.5 * h * steep * w


@inner_kernel
def element_basis(
    z: float, w: float, h: float, k: int, law: np.ndarray, springs: int, reach: float, softest: float
) -> float:
    """Return the derivative of the mean force by the number ``k`` of the law."""
    end = z + h * w
    middle = z + 0.5 * h * w
    if k >= springs:
        return damping_basis(middle, k - springs, reach) * w
    if abs(end - z) > NEAR * reach:
        before = spring_basis(z, k, law, springs, reach, softest)[1]
        after = spring_basis(end, k, law, springs, reach, softest)[1]
        return (after - before) / (end - z)
    first = spring_basis(z + GAUSS * (end - z), k, law, springs, reach, softest)[0]
    last = spring_basis(end - GAUSS * (end - z), k, law, springs, reach, softest)[0]
    return 0.5 * (first + last)
