"""Steps along a curve of solutions: predicted by the tangent, corrected across it; turning points between two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.continuation.newton import evaluated, solution, solved, tangent_of
from identification.continuation.path import Steps, System
from identification.errors import IdentificationError

__all__ = ["Point", "Walk"]

Float = NDArray[np.float64]

_GROWTH = 1.5
_EASY = 3
"""Newton iterations up to which the next step may be longer."""
_NEAR = 0.5
"""A solution farther from the tangent than this share of the step may belong to another part of the curve."""


@dataclass(frozen=True, eq=False)
class Point:
    """A solution: ``v = (z, p)``, and the unit tangent, in the units of length at that point."""

    v: Float
    units: Float
    tangent: Float
    iterations: int = 0

    def ahead(self, length: float) -> Float:
        """Where the tangent leads."""
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
        """Residual, and the derivatives in units of length with the plane ``across`` below."""
        residual, by_z, by_p = evaluated(self._system, v[:-1], float(v[-1]))
        rows = np.concatenate([by_z, by_p[:, None]], axis=1) * units
        return np.append(residual, 0.0), np.concatenate([rows, across[None]])

    def first(self, v: Float, direction: float) -> Point:
        """The point where the path begins, with the tangent along which the parameter sets out."""
        units = self._units(v)
        along = np.zeros(v.size)
        along[-1] = np.copysign(1.0, direction)
        tangent = self._tangent(v, units, along)
        if tangent is None:
            raise IdentificationError(f"parameter: the curve turns back just where it begins, at {v[-1]:g}")
        return Point(v, units, tangent)

    def _tangent(self, v: Float, units: Float, along: Float) -> Float | None:
        """Unit tangent on the side of ``along``."""
        return tangent_of(self._bordered(v, units, along)[1])

    def corrected(self, point: Point, length: float) -> Point | None:
        """The point of the curve ``length`` along the tangent of ``point``."""
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
        """A solution with its tangent, from the derivatives at the last iterate: as near as the solution itself."""
        along = tangent_of(matrix)
        if along is None:
            return None
        units = self._units(v)
        tangent = along * point.units / units
        return Point(v, units, tangent / np.linalg.norm(tangent), iterations)

    def next(self, last: Point, length: float) -> tuple[Point | None, float]:
        """The next point and the length to try after it; None if there is none."""
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

    def passes(self, first: Point, last: Point, step: float) -> bool:
        """Whether the step from ``last`` passes the very point where the path began."""
        away = (first.v - last.v) / last.units
        along = float(last.tangent @ away)
        if not 0.0 < along <= step or np.linalg.norm(away - along * last.tangent) > _NEAR * step:
            return False
        back = self.corrected(last, along)
        return back is not None and float(np.linalg.norm((back.v - first.v) / last.units)) <= 0.1 * step

    def at_parameter(self, last: Point, new: Point, value: float) -> Point | None:
        """The point between two whose parameter has a value."""
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
        tangent = self._tangent(v, last.units, new.tangent)
        return None if tangent is None else Point(v, last.units, tangent)

    def turn(self, last: Point, step: float) -> Float | None:
        """The point, within a step, where the parameter turns back."""
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
