"""Linear regression for the initial values of an element: the numbers in which its laws are linear, within their bounds."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from identification.models.structured.elements import NonlinearElement
from identification.models.structured.hysteresis import joint_forces
from identification.models.structured.laws import POSITIVE, Damper, Joint, Law, Spring
from identification.models.structured.model import StructuredModel
from vibrolock.arrays import Float

_LEAST_STIFFNESS, _LEAST_DAMPING = 0.25, 0.2
"""Smallest stiffness and damping that the initial element leaves of those of a mode, as ratios. Chosen: the mode stays one."""
_TINY = 1e-6
"""Initial value (N) of a positive number that the regression finds to be zero. Chosen: its logarithm must exist."""


class Regression(NamedTuple):
    """What a regression found."""

    direction: Float
    """Displacement of the element per coordinate of the modes of the regression."""
    scale_m: float
    laws: Sequence[Law]
    numbers: list[Float]
    """Linear numbers of each law, J or J s."""
    stiffness: Float
    """Change of the squared frequency of each mode."""
    damping: Float
    """Change of twice the damping ratio times the frequency of each mode, rad/s."""
    residual: float
    """Norm of what is left."""


def law_force(law: Law, x: Float, speed: Float) -> Float:
    """float[n]: force of a law over a period, N; ``speed`` is that of the element, m/s."""
    if isinstance(law, Spring):
        return law.force(x)
    if isinstance(law, Damper):
        return law.damping(x) * speed
    out, joint = np.zeros_like(x), cast(Joint, law)
    sliders, bends = (np.ascontiguousarray(one.T) for one in (joint.sliders(), joint.bends()))
    joint_forces(sliders, bends, np.ascontiguousarray(x), out)
    return out


def bounded_regression(laws: Sequence[Law], columns: Float, right: Float) -> tuple[list[Float], Float, float]:
    """Return the linear numbers of each law by least squares, the numbers after them, and the norm of what is left.

    The first columns are those of the linear numbers of ``laws``, which keep their bounds; those after them are free.
    """
    from scipy.optimize import lsq_linear  # only on use: it takes long to load

    sizes = np.array([law.n_linear for law in laws], dtype=int)
    least = np.full(columns.shape[1], -np.inf)
    least[: sizes.sum()] = np.repeat([law.least_linear for law in laws], sizes)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    bounds = (least, np.full(least.size, np.inf))
    numbers = lsq_linear(columns / scale, right, bounds=bounds, method="bvls").x / scale
    *parts, rest = np.split(numbers, np.cumsum(sizes))
    return parts, rest, float(np.linalg.norm(columns @ numbers - right))


def with_regression(
    model: StructuredModel, found: Regression, modes: Sequence[int], reach: float, plan: tuple[Float, tuple[str, ...]]
) -> StructuredModel:
    """Return the model with the element that a regression found, and with the corrections of ``modes``.

    ``plan``: direction of the element in all modes, and the channels between which it acts.
    """
    numbers = zip(found.laws, found.numbers, strict=True)
    element = NonlinearElement(
        direction=plan[0],
        scale_m=found.scale_m,
        laws=tuple(_initialised(law, linear, found.scale_m) for law, linear in numbers),
        reach=reach,
        between=plan[1],
    )
    omega, rate = model.omega.copy(), model.damping_ratio * model.omega
    for mode, softer, less in zip(modes, found.stiffness, found.damping, strict=True):
        omega[mode] = np.sqrt(max(omega[mode] ** 2 + softer, _LEAST_STIFFNESS * omega[mode] ** 2))
        rate[mode] = max(rate[mode] + 0.5 * less, _LEAST_DAMPING * rate[mode])
    changed = replace(model, frequency_hz=omega / (2.0 * np.pi), damping_ratio=rate / omega)
    return replace(changed, elements=(*model.elements, element))


def _initialised(law: Law, numbers: Float, scale_m: float) -> Law:
    if not law.linear:
        return law
    found = numbers / (scale_m**2 if isinstance(law, Damper) else scale_m)
    least = _TINY if law.free[law.linear] is POSITIVE else law.least_linear
    found = np.maximum(found, least)  # the bounds of the regression hold up to rounding
    value = getattr(law, law.linear)
    return replace(law, **{law.linear: tuple(found.tolist()) if isinstance(value, tuple) else float(found[0])})
