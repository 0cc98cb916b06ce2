"""Arc-length continuation: a curve of solutions of ``F(z, p) = 0``, followed through its turning points.

F gives as many values as there are unknowns z, and p is one parameter more. A step goes along the tangent and returns to
the curve by Newton's method in the plane across it (pseudo-arclength: Keller, in Applications of Bifurcation Theory, 1977;
Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapters 2 and 6), where nothing becomes singular at
a turning point. Length is measured in units that go with the curve,

    ds^2 = |dz / scale|^2 / max(1, |z / scale|)^2 + (dp / parameter_scale)^2,

so that one step control serves unknowns of every size: from ``scale`` on a step is a share of what is there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive

__all__ = ["Path", "Steps", "System", "continued", "solved"]

Float = NDArray[np.float64]
System = Callable[[Float, float], tuple[Float, Float, Float]]
"""``F(z, p)`` float[n] with its derivatives float[n, n] with respect to z and float[n] with respect to p."""
Ending = Literal["range", "size", "closed", "points", "step", "stopped"]

_GROWTH = 1.5
_EASY = 3
"""Newton iterations up to which the next step may be longer."""
_NEAR = 0.5
"""A solution farther from the tangent than this share of the step may belong to another part of the curve."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Step control of a continuation.

    Parameters
    ----------
    first, smallest, largest
        Length of the first step; shortest that is tried before the path ends; longest.
    angle_deg
        Largest angle between the tangents at both ends of a step.
    iterations
        Newton iterations before a step counts as failed.
    tolerance
        Length of the last Newton correction, with which a solution is accepted.
    """

    first: float = 0.02
    smallest: float = 1e-6
    largest: float = 0.1
    angle_deg: float = 20.0
    iterations: int = 8
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        for name in ("first", "smallest", "largest", "angle_deg", "tolerance"):
            positive(name, getattr(self, name))
        if self.iterations < 1:
            raise IdentificationError(f"iterations: is {self.iterations}, needs at least 1")


@dataclass(frozen=True, eq=False, kw_only=True)
class Path:
    """Points of a curve, in the order in which they were found.

    Parameters
    ----------
    unknowns, parameter
        float[n, n_unknowns], float[n].
    direction
        float[n], parameter's part of the unit tangent: its sign changes at turning points, where the derivative with
        respect to the unknowns is singular, and with it the sign of that derivative's determinant.
    turning_unknowns, turning_parameter
        float[k, n_unknowns], float[k], points where the parameter turns back.
    turning_after
        int[k], the last point before each.
    ending
        Why the path ends: it left the ``range`` of the parameter (then its last point is at the end of the range), grew
        beyond the allowed ``size``, ``closed`` on itself (then its last point is its first), has all its ``points``, no
        ``step`` however short leads on, or it was ``stopped``.
    reason
        What the one who stopped it said.
    """

    unknowns: Float
    parameter: Float
    direction: Float
    turning_unknowns: Float
    turning_parameter: Float
    turning_after: NDArray[np.int64]
    ending: Ending
    reason: str = ""


@dataclass(frozen=True, eq=False)
class _Point:
    """A solution: ``v = (z, p)``, and the unit tangent, in the units of length at that point."""

    v: Float
    units: Float
    tangent: Float
    iterations: int = 0

    def ahead(self, length: float) -> Float:
        """Where the tangent leads."""
        return np.asarray(self.v + length * self.tangent * self.units)


def solved(
    system: System, unknowns: ArrayLike, parameter: float, *, scale: ArrayLike = 1.0, steps: Steps | None = None
) -> Float | None:
    """Solution at one value of the parameter by Newton's method from ``unknowns``; None if it finds none."""
    z = np.array(unknowns, dtype=float)
    allowed, size = steps or Steps(), np.broadcast_to(np.asarray(scale, dtype=float), z.shape)
    for _ in range(allowed.iterations):
        residual, jacobian, _ = _evaluated(system, z, parameter)
        change = _solution(jacobian * size, -residual)
        if change is None:
            return None
        z = z + size * change
        if np.linalg.norm(change) <= allowed.tolerance * max(1.0, float(np.linalg.norm(z / size))):
            return z
    return None


def continued(
    system: System,
    unknowns: ArrayLike,
    parameter: float,
    *,
    scale: ArrayLike = 1.0,
    parameter_scale: float = 1.0,
    direction: float = 1.0,
    lowest: float = -np.inf,
    highest: float = np.inf,
    largest_size: float = np.inf,
    points: int = 1000,
    steps: Steps | None = None,
    stop: Callable[[Float, float], str] | None = None,
) -> Path:
    """Follow the curve of solutions through a point.

    Parameters
    ----------
    system
        F and its derivatives; where it cannot answer it may give inf or NaN, and the step counts as failed.
    unknowns, parameter
        float[n_unknowns] near a solution, and the parameter at which it is one.
    scale, parameter_scale
        Sizes of the unknowns (one or one each) and of the parameter by which lengths are measured.
    direction
        Sign with which the parameter sets out.
    lowest, highest
        Range of the parameter.
    largest_size
        Allowed ``|z / scale|``.
    points
        Most points.
    steps
        Step control.
    stop
        Asked at every point; a text ends the path there and is its ``reason``.

    Raises
    ------
    IdentificationError
        If there is no solution near the first point, or the parameter begins outside of its range.
    """
    allowed, z = steps or Steps(), np.array(finite_array("unknowns", unknowns, np.float64, 1))
    if not lowest <= parameter <= highest:
        raise IdentificationError(f"parameter: begins at {parameter:g}, allowed is {lowest:g} to {highest:g}")
    size = np.broadcast_to(np.asarray(scale, dtype=float), z.shape)
    if not (np.all(size > 0.0) and np.all(np.isfinite(size))):
        raise IdentificationError("scale: needs finite values above zero")
    begin = solved(system, z, parameter, scale=size, steps=allowed)
    if begin is None:
        raise IdentificationError(f"unknowns: no solution found near them at the parameter {parameter:g}")
    walk = _Walk(system, np.append(size, positive("parameter_scale", parameter_scale)), allowed)
    first = walk.first(np.append(begin, parameter), direction)
    found, turns, length = [first], list[tuple[int, Float]](), allowed.first
    ending: Ending = "points"
    reason = ""
    while len(found) < points and not reason:
        last = found[-1]
        new, length = walk.next(last, length)
        if new is None:
            ending = "step"
            break
        step = float(last.tangent @ ((new.v - last.v) / last.units))
        if walk.passes(first, last, step) and len(found) > 2:
            ending, new = "closed", first
        elif not lowest <= new.v[-1] <= highest:
            ending = "range"
            new = walk.at_parameter(last, new, lowest if new.v[-1] < lowest else highest)
        elif float(np.linalg.norm(new.v[:-1] / size)) > largest_size:
            ending, new = "size", None
        if new is None:
            break
        if new.tangent[-1] * last.tangent[-1] < 0.0 and (turn := walk.turn(last, step)) is not None:
            turns.append((len(found) - 1, turn))
        found.append(new)
        if ending in ("closed", "range"):
            break
        if stop is not None and (reason := stop(new.v[:-1], float(new.v[-1]))):
            ending = "stopped"
    return _path(found, turns, ending, reason)


def _path(found: list[_Point], turns: list[tuple[int, Float]], ending: Ending, reason: str) -> Path:
    points = np.array([point.v for point in found])
    turned = np.array([v for _, v in turns]).reshape(-1, points.shape[1])
    return Path(
        unknowns=points[:, :-1],
        parameter=points[:, -1],
        direction=np.array([point.tangent[-1] for point in found]),
        turning_unknowns=turned[:, :-1],
        turning_parameter=turned[:, -1],
        turning_after=np.array([index for index, _ in turns], dtype=np.int64),
        ending=ending,
        reason=reason,
    )


class _Walk:
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
        residual, by_z, by_p = _evaluated(self._system, v[:-1], float(v[-1]))
        rows = np.concatenate([by_z, by_p[:, None]], axis=1) * units
        return np.append(residual, 0.0), np.concatenate([rows, across[None]])

    def first(self, v: Float, direction: float) -> _Point:
        units = self._units(v)
        along = np.zeros(v.size)
        along[-1] = np.copysign(1.0, direction)
        tangent = self._tangent(v, units, along)
        if tangent is None:
            raise IdentificationError(f"parameter: the curve turns back just where it begins, at {v[-1]:g}")
        return _Point(v, units, tangent)

    def _tangent(self, v: Float, units: Float, along: Float) -> Float | None:
        """Unit tangent on the side of ``along``."""
        return _tangent_of(self._bordered(v, units, along)[1])

    def corrected(self, point: _Point, length: float) -> _Point | None:
        """The point of the curve ``length`` along the tangent of ``point``."""
        v, begin = point.ahead(length), point.ahead(length)
        for count in range(1, self._steps.iterations + 1):
            residual, matrix = self._bordered(v, point.units, point.tangent)
            change = _solution(matrix, -residual)
            if change is None:
                return None
            v = v + change * point.units
            if np.linalg.norm((v - begin) / point.units) > max(_NEAR * abs(length), self._steps.tolerance):
                return None
            if np.linalg.norm(change) <= self._steps.tolerance:
                return self._arrived(point, v, matrix, count)
        return None

    def _arrived(self, point: _Point, v: Float, matrix: Float, iterations: int) -> _Point | None:
        """A solution with its tangent, from the derivatives at the last iterate: as near as the solution itself."""
        along = _tangent_of(matrix)
        if along is None:
            return None
        units = self._units(v)
        tangent = along * point.units / units
        return _Point(v, units, tangent / np.linalg.norm(tangent), iterations)

    def next(self, last: _Point, length: float) -> tuple[_Point | None, float]:
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

    def passes(self, first: _Point, last: _Point, step: float) -> bool:
        """Whether the step from ``last`` passes the very point where the path began."""
        away = (first.v - last.v) / last.units
        along = float(last.tangent @ away)
        if not 0.0 < along <= step or np.linalg.norm(away - along * last.tangent) > _NEAR * step:
            return False
        back = self.corrected(last, along)
        return back is not None and float(np.linalg.norm((back.v - first.v) / last.units)) <= 0.1 * step

    def at_parameter(self, last: _Point, new: _Point, value: float) -> _Point | None:
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
        return None if tangent is None else _Point(v, last.units, tangent)

    def turn(self, last: _Point, step: float) -> Float | None:
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


def _tangent_of(bordered: Float) -> Float | None:
    """Unit tangent on the side of the last row."""
    right = np.zeros(len(bordered))
    right[-1] = 1.0
    tangent = _solution(bordered, right)
    return None if tangent is None else tangent / np.linalg.norm(tangent)


def _evaluated(system: System, z: Float, parameter: float) -> tuple[Float, Float, Float]:
    with np.errstate(all="ignore"):
        return system(z, parameter)


def _solution(matrix: Float, right: Float) -> Float | None:
    """Solution of linear equations whose rows may be of any size; None if there is none."""
    with np.errstate(all="ignore"):
        size = np.max(np.abs(matrix), axis=1)
        if not (np.all(np.isfinite(size)) and np.all(np.isfinite(right)) and np.all(size > 0.0)):
            return None
        try:
            found = np.linalg.solve(matrix / size[:, None], right / size)
        except np.linalg.LinAlgError:
            return None
    return found if np.all(np.isfinite(found)) else None
