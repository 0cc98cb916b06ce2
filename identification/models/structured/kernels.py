"""Compiled laws of nonlinear elements, over a displacement x without unit: tabulated springs and dampers, and sliders.

A spring is a table [3, nodes] over ``-reach <= x <= reach``: force, slope times the distance of the nodes, and potential, with
cubics between the nodes, and straight lines beyond. A damper is a row [nodes], linear between the nodes and constant beyond.
A slider is Jenkins' element: a spring in series with dry friction. Derivatives by the numbers of a law are tables as well, for
the tables depend on them linearly.
"""

import math

import numpy as np

from vibrolock.compiled import inner_kernel

NEAR = 1e-3  # of the reach: over shorter ways the mean force is that of two Gauss points, which is exact to rounding
GAUSS = 0.5 - 0.5 / math.sqrt(3.0)  # place of the first of two Gauss points on the unit interval


@inner_kernel
def spring_at(x: float, table: np.ndarray, limits: np.ndarray) -> tuple[float, float, float]:
    """Return force, slope and potential. ``limits``: reach, and the slopes of the lines below and above it."""
    reach, cells = limits[0], table.shape[1] - 1
    if abs(x) > reach:
        end, slope = (cells, limits[2]) if x > 0.0 else (0, limits[1])
        beyond, force = x - math.copysign(reach, x), table[0, end]
        return force + slope * beyond, slope, table[2, end] + beyond * (force + 0.5 * slope * beyond)
    length = 2.0 * reach / cells
    at = (x + reach) / length
    i = min(int(at), cells - 1)
    t = at - i
    begin, rise, first, last = table[0, i], table[0, i + 1] - table[0, i], table[1, i], table[1, i + 1]
    square, cube = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
    force = begin + t * (first + t * (square + t * cube))
    slope = (first + t * (2.0 * square + 3.0 * t * cube)) / length
    potential = table[2, i] + length * t * (begin + t * (0.5 * first + t * (square / 3.0 + 0.25 * t * cube)))
    return force, slope, potential


@inner_kernel
def damping_at(x: float, row: np.ndarray, reach: float) -> tuple[float, float]:
    """Return the damping and its slope."""
    cells = row.size - 1
    if abs(x) >= reach:
        return row[cells if x > 0.0 else 0], 0.0
    length = 2.0 * reach / cells
    at = (x + reach) / length
    i = min(int(at), cells - 1)
    rise = row[i + 1] - row[i]
    return row[i] + (at - i) * rise, rise / length


@inner_kernel
def jenkins_step(r: float, stiffness: float, strength: float, way: float) -> tuple[float, float, float, float]:
    """Move a slider with the force ``r`` along ``way`` at constant speed.

    Return mean force, force at the end, and the derivatives of the mean by ``way`` and by ``r``. The slider sticks if the last
    is 1. Mean force times way is the work: never less than the rise of ``r^2/(2 stiffness)``.
    """
    sign = math.copysign(1.0, way)
    size, before = abs(way), sign * r
    missing = strength - before
    if stiffness * size <= missing:
        return r + 0.5 * stiffness * way, r + stiffness * way, 0.5 * stiffness, 1.0
    share = missing / (stiffness * size)
    return sign * (strength - 0.5 * missing * share), sign * strength, 0.5 * stiffness * share * share, share


@inner_kernel
def mean_spring(x: float, way: float, table: np.ndarray, limits: np.ndarray) -> tuple[float, float, float]:
    """Return the mean force from ``x`` to ``x + way``, and its derivatives by ``x`` and by ``way``."""
    end = x + way
    if abs(way) > NEAR * limits[0]:
        first, _, before = spring_at(x, table, limits)
        last, _, after = spring_at(end, table, limits)
        mean = (after - before) / way
        return mean, (last - first) / way, (last - mean) / way
    first, steep_first, _ = spring_at(x + GAUSS * way, table, limits)
    last, steep_last, _ = spring_at(end - GAUSS * way, table, limits)
    by_end = 0.5 * (GAUSS * steep_first + (1.0 - GAUSS) * steep_last)
    return 0.5 * (first + last), 0.5 * (steep_first + steep_last), by_end


@inner_kernel
def step_force(
    x: float, w: float, h: float, table: np.ndarray, row: np.ndarray, limits: np.ndarray
) -> tuple[float, float, float]:
    """Return the mean force of spring and damper over a step with the rate ``w``, and its derivatives by ``x`` and ``w``."""
    mean, by_x, by_way = mean_spring(x, h * w, table, limits)
    damping, steep = damping_at(x + 0.5 * h * w, row, limits[0])
    return mean + damping * w, by_x + steep * w, h * by_way + damping + 0.5 * h * steep * w
