"""Compiled steps of elements with memory: Jenkins sliders, and hystereses of Bouc and Wen, along a way at constant speed.

The force r of a hysteresis of Bouc and Wen (Bouc 1967; Wen, J. Eng. Mech. Div. ASCE 102, 1976, 249), with stiffness k, yield
force y, exponent n and ratio gamma of the usual gamma to the usual beta, follows the displacement x, not the time:

    ``dr/dx = k g(w)``,  ``w = r sgn(dx) / y``,  ``g = 1 - (1 + gamma) w^n`` for ``w >= 0``, ``1 + (1 - gamma) |w|^n`` below

Along a way in one direction w only rises, by one equation, ``dw/ds = g(w)`` with ``s = |x| k/y``. It is integrated here by the
method of Runge and Kutta in pieces that are short against the bends of g; at ``w = 0``, where g has a bend, and at the largest
force a piece ends, after a way that is Gauss' quadrature of ``1/g``. The work is integrated along, so that the mean force over
a step belongs to the change of the state. ``g`` is larger below zero (unloading) than above (loading) at the same ``|w|``, so
that the work is never less than the rise of the energy ``integral of r dr/(k g(-|r|/y))`` that unloading gives back.

Dry friction has no memory. Where it is large enough it brings the structure to rest at the end of a step. By the midpoint rule
the way of that step, ``to_rest``, is half of what the speed at its beginning would give. (After a step without any way the
speed would be the opposite one, and so it would go on.) Beyond that way the force is ``k`` times the rest of the way, up to
the largest force, with a k so large that a structure that is held hardly moves. Along a shorter way the force is zero, and
along a way back it opposes that one, so that its work is never negative. By Stribeck's law the force falls from its largest
value, at rest, with the way of a step, that is with the speed, as ``y + (largest - y) exp(-(way/gamma)^2)``, with the way gamma
of a step at Stribeck's speed.

A row of `Tables.bends` is ``[y, n, gamma]``; n is 0 for a Jenkins slider and below zero for dry friction, with gamma 0 where it
does not depend on the speed.
"""

import math

import numpy as np

from identification.models.structured.kernels import jenkins_step
from vibrolock.compiled import inner_kernel, kernel, unlocked_kernel

PIECE = 0.1  # length of a piece relative to that over which g changes by as much as w: errors of 1e-6
SMALL = 0.01  # w below which a piece may change it by so much
LEAST = 1e-4  # share of a way that a piece is at least, so that they end
FULL = 1.0 - 1e-13  # share of the largest force from which on a hysteresis slips
SHORT = 1e-7  # ways below which the mean force is that of a straight line
GAUSS = np.polynomial.legendre.leggauss(5)
PLACES, WEIGHTS = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
NUDGE = 1e-5  # step of the central differences by numbers of a hysteresis


@kernel
def slope_at(w: float, n: float, gamma: float) -> float:
    """Return g."""
    if w >= 0.0:
        return float(1.0 - (1.0 + gamma) * w**n)
    return float(1.0 + (1.0 - gamma) * (-w) ** n)


@kernel
def way_between(first: float, last: float, n: float, gamma: float) -> tuple[float, float]:
    """Return the way from one w to another, and the integral of ``w - first`` along it."""
    way, area = 0.0, 0.0
    for i in range(PLACES.size):
        rise = PLACES[i] * (last - first)
        part = WEIGHTS[i] * (last - first) / slope_at(first + rise, n, gamma)
        way += part
        area += part * rise
    return way, area


@kernel
def piece(w: float, largest: float, g: float, n: float, gamma: float) -> float:
    """Return how long a piece that begins at w may be: g hardly changes, nor does w unless it is small."""
    size, bend = abs(w), 1.0 + gamma if w >= 0.0 else 1.0 - gamma
    rise = SMALL + 0.25 * size
    size = max(min(size + rise, largest) if w >= 0.0 else size, SMALL)
    return float(min(PIECE / max(abs(bend) * n * size ** (n - 1.0), 1e-9), rise / g))


@kernel
def along(w: float, largest: float, n: float, gamma: float, way: float) -> tuple[float, float]:
    """Return w after a way, and its mean less the first, w at most ``largest``."""
    first, left, area = w, way, 0.0
    while left > 0.0:
        g = slope_at(w, n, gamma)
        if w >= largest * FULL or not g > 0.0:
            area += (w - first) * left
            break
        end = 0.0 if w < 0.0 else largest
        length = min(left, max(piece(w, largest, g, n, gamma), LEAST * way))
        if w + length * max(g, slope_at(min(w + length * g, end), n, gamma)) >= end:
            to_end, under = way_between(w, end, n, gamma)
            if 0.0 < to_end <= length:
                area += under + (w - first) * to_end
                left -= to_end
                w = end
                continue
        k2 = slope_at(w + 0.5 * length * g, n, gamma)
        k3 = slope_at(w + 0.5 * length * k2, n, gamma)
        k4 = slope_at(w + length * k3, n, gamma)
        area += (w - first) * length + length * length / 6.0 * (g + k2 + k3)
        w = min(max(w + length / 6.0 * (g + 2.0 * k2 + 2.0 * k3 + k4), w), end)
        left -= length
    return w, area / way


@kernel
def dry_friction(at_rest: float, sliding: float, scale: float, speed: float) -> tuple[float, float]:
    """Return the size of dry friction at a speed, at least 0, and its derivative by it; ``scale`` 0: that at rest."""
    if scale == 0.0:
        return at_rest, 0.0
    share = speed / scale
    more = (at_rest - sliding) * math.exp(-share * share)
    return sliding + more, -2.0 * share / scale * more


@kernel
def memory_of(r: float, bend: np.ndarray, to_rest: float) -> float:
    """Return what a step depends on beside its way: the force ``r`` at its beginning; for dry friction the way to rest."""
    return to_rest if bend[1] < 0.0 else r


@kernel
def dry_step(size: float, by_size: float, k: float, way: float, to_rest: float) -> tuple[float, float, float]:
    """Return the mean of dry friction over a step, and its derivatives by ``way`` and by ``to_rest``.

    ``size`` and ``by_size``: its largest value, and the derivative of that by the size of ``way``.
    """
    if min(to_rest, 0.0) < way < max(to_rest, 0.0):
        return 0.0, 0.0, 0.0
    held = to_rest if way * to_rest > 0.0 else 0.0
    pull = k * (way - held)
    if abs(pull) >= size:
        return math.copysign(size, pull), by_size, 0.0
    return pull, k, -k if held != 0.0 else 0.0


@kernel
def hysteresis_step(
    r: float, k: float, largest: float, y: float, n: float, gamma: float, way: float
) -> tuple[float, float, float, float, float, float]:
    """Move a hysteresis with the force ``r`` along ``way``. For dry friction ``r`` is its way to rest (`memory_of`).

    Return mean force, force at the end, the derivatives of the mean by ``way`` and by ``r``, and those of the end. They follow
    from the equation, which knows x by its differential only: ``d w/d w0 = g(w)/g(w0)``.
    """
    if n < 0.0:
        size, by_size = dry_friction(largest, y, gamma, abs(way))
        dry, by, by_rest = dry_step(size, by_size, k, way, r)
        return dry, dry, by, by_rest, by, by_rest
    sign = math.copysign(1.0, way)
    most = largest / y
    first = min(sign * r / y, most)
    before = 0.0 if first >= most * FULL else max(slope_at(first, n, gamma), 0.0)
    s = abs(way) * k / y
    if s < SHORT:
        half = 0.5 * s * before
        return sign * y * (first + half), sign * y * (first + 2.0 * half), 0.5 * k * before, 1.0, k * before, 1.0
    last, mean = along(first, most, n, gamma, s)
    after = 0.0 if last >= most * FULL else max(slope_at(last, n, gamma), 0.0)
    by_way = k * (last - first - mean) / s
    by_r, end_by_r = ((last - first) / (before * s), after / before) if before > 0.0 else (0.0, 0.0)
    return sign * y * (first + mean), sign * y * last, by_way, by_r, k * after, end_by_r


@inner_kernel
def slider_step(r: float, slider: np.ndarray, bend: np.ndarray, way: float) -> tuple[float, float, float]:
    """Move a slider or a hysteresis; return mean force, force at the end, and the derivative of the mean by ``way``.

    ``r`` is that of `memory_of`.
    """
    if bend[1] == 0.0:
        mean, end, by_way, _ = jenkins_step(r, slider[0], slider[1], way)
        return mean, end, by_way
    mean, end, by_way, _, _, _ = hysteresis_step(r, slider[0], slider[1], bend[0], bend[1], bend[2], way)
    return mean, end, by_way


@kernel
def hysteresis_by(
    r: float, slider: np.ndarray, bend: np.ndarray, by: np.ndarray, by_bend: np.ndarray, way: float
) -> tuple[float, float]:
    """Return the derivatives of mean force and force at the end by a number on which the rows depend with ``by``."""
    mean, end = 0.0, 0.0
    for sign in (1.0, -1.0):
        nudge = sign * NUDGE
        of_mean, of_end, _, _, _, _ = hysteresis_step(
            r,
            slider[0] + nudge * by[0],
            slider[1] + nudge * by[1],
            bend[0] + nudge * by_bend[0],
            bend[1] + nudge * by_bend[1],
            bend[2] + nudge * by_bend[2],
            way,
        )
        mean += sign * of_mean
        end += sign * of_end
    return 0.5 * mean / NUDGE, 0.5 * end / NUDGE


@unlocked_kernel
def joint_forces(sliders: np.ndarray, bends: np.ndarray, x: np.ndarray, out: np.ndarray) -> None:
    """Add the force of sliders [n, 2] and [n, 3] in the second of two periods with the displacement ``x``."""
    for s in range(sliders.shape[0]):
        r, last = 0.0, x[x.size - 1]
        for repeat in range(2):
            for k in range(x.size):
                r = slider_step(memory_of(r, bends[s], 0.0), sliders[s], bends[s], x[k] - last)[1]
                last = x[k]
                if repeat == 1:
                    out[k] += r
