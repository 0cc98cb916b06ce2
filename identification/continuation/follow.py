"""Follow a curve from one point until it leaves the range, closes or ends."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from identification.continuation.newton import solved
from identification.continuation.path import Ending, Path, Steps, System
from identification.continuation.walk import Point, Walk
from identification.errors import IdentificationError
from identification.validation import finite_array, positive
from vibrolock.arrays import Float


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
    points: int = 1000,
    steps: Steps | None = None,
    stop: Callable[[Float, float], str] | None = None,
) -> Path:
    """Follow the curve of solutions through a point.

    Raises `IdentificationError` if there is no solution near the first point, or if the parameter begins outside its
    range.

    Parameters
    ----------
    system
        F and its derivatives. Where F cannot be evaluated it may return inf or NaN; the step then counts as failed.
    unknowns, parameter
        float[n_unknowns], unknowns near a solution, and the parameter of that solution.
    scale, parameter_scale
        Units of length: sizes of the unknowns (one for all, or one each) and of the parameter.
    direction
        Sign of the first change of the parameter.
    lowest, highest
        Range of the parameter.
    points
        Largest number of points.
    steps
        Step control.
    stop
        Called with the unknowns and the parameter at every point, including the first and the last. A text that is not empty
        ends the path there and becomes its ``reason``.
    """
    allowed, z = steps or Steps(), np.array(finite_array("unknowns", unknowns, np.float64, 1))
    if not lowest <= parameter <= highest:
        raise IdentificationError(f"begins at {parameter:g}", field="parameter", allowed=f"{lowest:g} to {highest:g}")
    size = np.broadcast_to(np.asarray(scale, dtype=float), z.shape)
    if not (np.all(size > 0.0) and np.all(np.isfinite(size))):
        raise IdentificationError(field="scale", allowed="finite values above zero")
    begin = solved(system, z, parameter, scale=size, steps=allowed)
    if begin is None:
        raise IdentificationError(f"no solution found near them at the parameter {parameter:g}", field="unknowns")
    walk = Walk(system, np.append(size, positive("parameter_scale", parameter_scale)), allowed)
    first = walk.first(np.append(begin, parameter), direction)
    found, turns, length = [first], list[tuple[int, Float]](), allowed.first
    reason = "" if stop is None else stop(begin, float(parameter))
    ending: Ending = "stopped" if reason else "points"
    while len(found) < points and not reason:
        last = found[-1]
        new, length = walk.next(last, length)
        if new is None and allowed.kinks and (beyond := walk.beyond_kink(last)) is not None:
            if beyond.tangent[-1] * last.tangent[-1] < 0.0:
                turns.append((len(found) - 1, last.v))
            found[-1] = last = beyond
            new, length = walk.next(last, allowed.first)
        if new is None:
            ending = "step"
            break
        step = float(last.tangent @ ((new.v - last.v) / last.units))
        if walk.passes(first, last, step) and len(found) > 2:
            ending, new = "closed", first
        elif not lowest <= new.v[-1] <= highest:
            ending = "range"
            new = walk.at_parameter(last, new, lowest if new.v[-1] < lowest else highest)
        if new is None:
            break
        if new.tangent[-1] * last.tangent[-1] < 0.0 and (turn := walk.turn(last, step)) is not None:
            turns.append((len(found) - 1, turn))
        found.append(new)
        if stop is not None and (reason := stop(new.v[:-1], float(new.v[-1]))):
            ending = "stopped"
        if ending in ("closed", "range"):
            break
    return _path(found, turns, ending, reason)


def _path(found: list[Point], turns: list[tuple[int, Float]], ending: Ending, reason: str) -> Path:
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
