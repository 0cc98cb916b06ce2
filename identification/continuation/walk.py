"""Steps along a curve of solutions: predict along the tangent, correct normal to it, and locate turning points."""

from dataclasses import dataclass

import numpy as np

from identification.continuation.newton import evaluated, solution, solved, tangent_of
from identification.continuation.path import Steps, System
from identification.errors import IdentificationError
from vibrolock.arrays import Float

_GROWTH = 1.5  # factor of the step length after an easy step; chosen
_EASY = 3
"""Largest number of Newton iterations after which the step length may grow."""
_AHEAD = 20.0
"""Distance at which the tangent beyond a kink is found, in shortest steps."""
_NEAR = 0.5
"""Farthest distance of a solution from the prediction, as a share of the step; beyond it may lie another part of the curve."""


@dataclass(frozen=True, eq=False)
class Point:
    """A solution ``v = (z, p)`` with its units of length and the unit tangent in these units."""

    v: Float
    units: Float
    tangent: Float
    iterations: int = 0

    def ahead(self, length: float) -> Float:
        """Return the point ``length`` along the tangent."""
        return np.asarray(self.v + length * self.tangent * self.units)


class Walk:
    """Steps along a curve."""

    def __init__(self, system: System, scale: Float, steps: Steps) -> None:
        self._system, self._scale, self._steps = system, scale, steps
        self._turned = float(np.cos(np.radians(steps.angle_deg)))

    def _units(self, v: Float) -> Float:
        units = np.array(self._scale)
        units[:-1] *= max(1.0, float(np.linalg.norm(v[:-1] / units[:-1])))
        return units

    def _bordered(self, v: Float, units: Float, across: Float) -> tuple[Float, Float]:
        """Return residual and Jacobian in units of length; the last row of the Jacobian is ``across``, its residual 0."""
        residual, by_z, by_p = evaluated(self._system, v[:-1], float(v[-1]))
        rows = np.concatenate([by_z, by_p[:, None]], axis=1) * units
        return np.append(residual, 0.0), np.concatenate([rows, across[None]])

    def first(self, v: Float, direction: float) -> Point:
        """Return the first point, with the tangent along which the parameter changes in ``direction``."""
        units = self._units(v)
        along = np.zeros(v.size)
        along[-1] = np.copysign(1.0, direction)
        tangent = tangent_of(self._bordered(v, units, along)[1])
        if tangent is None:
            raise IdentificationError(f"the curve turns back just where it begins, at {v[-1]:g}", field="parameter")
        return Point(v, units, tangent)

    def corrected(self, point: Point, length: float) -> Point | None:
        """Correct the prediction ``length`` along the tangent of ``point``; return None if Newton's method fails."""
        v, begin = point.ahead(length), point.ahead(length)
        for count in range(1, self._steps.iterations + 1):
            residual, matrix = self._bordered(v, point.units, point.tangent)
            change = solution(matrix, -residual)
            if change is None:
                return None
            v = v + change * point.units
            if np.linalg.norm((v - begin) / point.units) > max(_NEAR * abs(length), self._steps.tolerance):
                return None
            if np.linalg.norm(change) <= self._steps.tolerance:
                return self._arrived(point, v, matrix, count)
        return None

    def _arrived(self, point: Point, v: Float, matrix: Float, iterations: int) -> Point | None:
        """Return the solution with its tangent, computed from the Jacobian of the last iterate, which is accurate enough."""
        along = tangent_of(matrix)
        if along is None:
            return None
        units = self._units(v)
        tangent = along * point.units / units
        return Point(v, units, tangent / np.linalg.norm(tangent), iterations)

    def next(self, last: Point, length: float) -> tuple[Point | None, float]:
        """Return the next point and the step length to try after it; the point is None if even the shortest step fails."""
        while length >= self._steps.smallest:
            new = self.corrected(last, length)
            if new is not None:
                before = last.tangent * last.units / new.units
                cosine = float(before @ new.tangent / np.linalg.norm(before))
                if cosine >= self._turned:
                    easy = new.iterations <= _EASY and cosine >= 0.5 * (1.0 + self._turned)
                    return new, min(length * _GROWTH if easy else length, self._steps.largest)
            length *= 0.5
        return None, length

    def beyond_kink(self, last: Point) -> Point | None:
        """Return the same point with the tangent of the curve just ahead, which differs from its own at a kink."""
        ahead = last.ahead(_AHEAD * self._steps.smallest)
        along = tangent_of(self._bordered(ahead, last.units, last.tangent)[1])
        return None if along is None else Point(last.v, last.units, along)

    def passes(self, first: Point, last: Point, step: float) -> bool:
        """Return whether the step from ``last`` passes through the first point of the path."""
        away = (first.v - last.v) / last.units
        along = float(last.tangent @ away)
        if not 0.0 < along <= step or np.linalg.norm(away - along * last.tangent) > _NEAR * step:
            return False
        back = self.corrected(last, along)
        return back is not None and float(np.linalg.norm((back.v - first.v) / last.units)) <= 0.1 * step

    def at_parameter(self, last: Point, new: Point, value: float) -> Point | None:
        """Return the point between ``last`` and ``new`` whose parameter is ``value``; None if there is none."""
        share = (value - last.v[-1]) / (new.v[-1] - last.v[-1])
        z = solved(
            self._system,
            last.v[:-1] + share * (new.v[:-1] - last.v[:-1]),
            value,
            scale=last.units[:-1],
            steps=self._steps,
        )
        if z is None:
            return None
        v = np.append(z, value)
        tangent = tangent_of(self._bordered(v, last.units, new.tangent)[1])
        return None if tangent is None else Point(v, last.units, tangent)

    def turn(self, last: Point, step: float) -> Float | None:
        """Return the turning point within a step from ``last``; None if it is not found."""
        from scipy.optimize import brentq

        def direction(length: float) -> float:
            at = self.corrected(last, length)
            return np.nan if at is None else float(at.tangent[-1])

        try:
            length = brentq(direction, 0.0, step, xtol=1e-7 * step, rtol=1e-12)
        except (ValueError, RuntimeError):
            return None
        at = self.corrected(last, length)
        return None if at is None else at.v
