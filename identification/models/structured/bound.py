"""A bound for the motion of a structured model at any time, proved for the steps that are simulated.

Notation of `steps`; V is the mean velocity of a step, Q its mean displacement ``q + h V/2``, E the
energy with ``r^2/(2 k)`` of the sliders. Over a step, exactly (products have exact differences at midpoints),

    ``dE = h (V.b U - V.C V - sum c w^2 - friction)``
    ``d(q.v + q.C q/2) = h (V.V - Q.K Q - sum x (F + c w + R) + Q.b U)``

For ``W = E + eps (q.v + q.C q/2)`` follows ``dW <= h (-(1 - theta) S + g U^2 + k)``, ``S = V.A V + eps Q.B Q``, from

- ``x F >= s x^2 - kappa - L (h w)^2/12``, if the spring has ``x f(x) >= s x^2 - kappa`` everywhere and slopes up to L,
- ``c w^2 + eps x c w >= -eps^2 c x^2/4`` and ``|x R| <= tau x^2 + (sum of strengths)^2/(4 tau)``,
- ``(V + eps Q).b U <= theta S + U^2 (b.A^-1 b + eps b.B^-1 b)/(4 theta)``.

The end of the step is ``q = Q + h V/2``, ``v = V + h a/2`` with the acceleration a of the equation of the step, so that
its W is at most ``mu S + nu U^2 + k1``. Hence ``W_1 (1 + lambda h) <= W_0 + h (...)`` with ``lambda = (1 - theta)/mu``, and
W never exceeds ``(g/lambda + nu) m + k/lambda + k1``, where m is the mean square of the force with weights that fade with the
rate lambda.
"""

from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from identification.models.structured.elements import Tables
from identification.models.structured.model import StructuredModel
from identification.models.structured.steps import System
from identification.validation import positive
from vibrolock.arrays import Float

_EPS = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
"""Tried values of eps, relative to the smallest damping."""
_THETA = (0.3, 0.5, 0.7)  # tried values of theta; chosen
_SLOPES = (0.0, 0.5, 0.9, 0.99)
"""Tried values of s, relative to the smallest slope of the springs beyond their reach."""
_FAR = np.linspace(-10.0, 10.0, 4001)
"""Displacements over the reach at which inequalities of springs are evaluated; beyond them they are straight lines."""
_SPLIT = 0.3
"""Weight of the products in ``|a + b|^2 <= (1 + split) |a|^2 + (1 + 1/split) |b|^2``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """What no motion from rest exceeds, under any force whose fading mean square is at most ``force_rms_n`` squared.

    Parameters
    ----------
    force_rms_n
        Root of the largest mean square of the force with weights ``exp(-t / memory_s)``; the peak of a force is one.
    memory_s
        Time constant of the weights.
    energy_j
        Largest W.
    displacement_m
        float[n_elements], largest displacement of each element.
    output_m, output_m_s
        float[n_outputs], largest displacement and velocity at each output.
    """

    force_rms_n: float
    memory_s: float
    energy_j: float
    displacement_m: Float
    output_m: Float
    output_m_s: Float


def bound_of(model: StructuredModel, force_rms_n: float) -> Bound:
    """Return the lowest bound that the tried constants give, for a model with one force.

    Not included: steps whose equation is not solved (`Motion.unsolved_steps` counts them).
    Raises `IdentificationError` if the force is not above zero.

    Parameters
    ----------
    model
        A structured model with one force.
    force_rms_n
        RMS of the force, N; above zero.
    """
    force = positive("force_rms_n", force_rms_n)
    system = model.system
    effective = force + (model.support_largest_n if model.support_n_m > 0.0 else 0.0)
    found = [
        one
        for eps, theta, share in product(_EPS, _THETA, _SLOPES)
        if (one := _with(system, effective, eps, theta, share)) is not None
    ]
    energy, rate, quadratic = min(found, key=lambda one: one[0])
    inverse = np.linalg.inv(quadratic)

    def largest(rows: Float, velocity: bool) -> Float:
        both = np.hstack([rows, 0.0 * rows] if velocity else [0.0 * rows, rows])
        return np.asarray(np.sqrt(energy * np.einsum("ri,ij,rj->r", both, inverse, both)))

    scale = np.array([element.scale_m for element in model.elements])
    return Bound(
        force_rms_n=force,
        memory_s=1.0 / rate,
        energy_j=energy,
        displacement_m=largest(system.phi, False) * scale,
        output_m=largest(model.output_shapes, False),
        output_m_s=largest(model.output_shapes, True),
    )


class _Spring(NamedTuple):
    """Quadratic limits of a spring: ``x f >= s x^2 - kappa``, ``low x^2/2 - below <= P <= high x^2/2 + above``."""

    s: float
    kappa: float
    steepest: float
    """Largest slope."""
    middle: float
    half: float
    """Middle of the secants ``f/x``, and half of their range."""
    low: float
    below: float
    high: float
    above: float


def _spring(tables: Tables, e: int, share: float) -> _Spring:
    reach, low_slope, high_slope = tables.limits[e]
    nodes = tables.springs[e].shape[1]
    x = _FAR * reach
    inside = np.clip(x, -reach, reach)
    at = np.linspace(-reach, reach, nodes)
    slope = np.where(x < 0.0, low_slope, high_slope)
    beyond = x - inside
    edge = np.interp(inside, at, tables.springs[e, 0])
    force = edge + slope * beyond
    potential = np.interp(inside, at, tables.springs[e, 2]) + beyond * (edge + 0.5 * slope * beyond)
    tails = np.array([low_slope, high_slope])
    s = min(tails.min(), 0.0) if share == 0.0 else share * tails.min() if tails.min() > 0.0 else tails.min() / share
    s -= 1e-3 * np.ptp(tails) + 1e-9
    high = max(1.02 * tails.max(), 0.0) + 1e-9
    low = s
    rise = np.diff(tables.springs[e, 0]).max() * (nodes - 1) / (2.0 * reach)
    secants = np.append((force[x != 0.0] / x[x != 0.0]), tails)
    return _Spring(
        s=float(s),
        kappa=float(max(np.max(s * x**2 - x * force), 0.0)) * 1.01,
        steepest=float(max(rise, tails.max(), 0.0)) * 1.01,
        middle=0.5 * float(secants.min() + secants.max()),
        half=0.51 * float(np.ptp(secants)),
        low=float(low),
        below=float(max(np.max(0.5 * low * x**2 - potential), 0.0)) * 1.01,
        high=float(high),
        above=float(max(np.max(potential - 0.5 * high * x**2), 0.0)) * 1.01,
    )


def _with(
    system: System, force: float, eps_share: float, theta: float, slope_share: float
) -> tuple[float, float, Float] | None:
    """Return W with the lower potential added, the rate, and the quadratic form that it bounds; None if no bound follows."""
    n, h, tables, phi = len(system.omega), system.step_s, system.tables, system.phi
    b, eye, zero = system.b[:, 0], np.eye(n), np.zeros((n, n))
    rates = 2.0 * system.zeta * system.omega
    damping, stiffness = np.diag(rates), np.diag(system.omega**2)
    eps = eps_share * float(rates.min())
    springs = [_spring(tables, e, slope_share) for e in range(len(phi))]
    slope, kappa, steepest, middle, half, low, below, high, above = np.reshape(springs, (-1, len(_Spring._fields))).T
    most_damping = tables.dampers.max(axis=1, initial=0.0)
    strength = np.array([tables.sliders[a:b, 1].sum() for a, b in pairwise(tables.first)])
    static = 1.0 / np.maximum(np.sum((phi / system.omega) ** 2, axis=1), 1e-300)
    tau = np.where(strength > 0.0, 0.02 * static, 0.0)

    def form(weights: Float) -> Float:
        return np.asarray((phi.T * weights) @ phi)

    a_form = damping - eps * eye - form(eps * (steepest + np.maximum(-slope, 0.0)) * h**2 / 12.0)
    b_form = stiffness + form(slope - tau - 0.25 * eps * most_damping)
    joints = strength > 0.0
    constant = eps * float(np.sum(kappa) + np.sum(strength[joints] ** 2 / (4.0 * tau[joints])))
    if np.linalg.eigvalsh(a_form)[0] <= 0.0 or np.linalg.eigvalsh(b_form)[0] <= 0.0:
        return None
    s_form = np.block([[a_form, zero], [zero, eps * b_form]])
    g = (b @ np.linalg.solve(a_form, b) + eps * b @ np.linalg.solve(b_form, b)) / (4.0 * theta)

    # the end of the step: a linear map, and what is left of the elements and the force
    to_q = np.hstack([0.5 * h * eye, eye])
    by_rate, by_place = damping + form(0.5 * most_damping), stiffness + form(middle)
    to_v = np.hstack([eye - 0.5 * h * by_rate, -0.5 * h * by_place])
    rest = (1.0 + 1.0 / _SPLIT) * 0.25 * h**2 * (len(phi) + 1.0)
    sizes = rest * np.sum(phi**2, axis=1)
    mean_square = (1.0 + _SPLIT) * to_v.T @ to_v
    mean_square[n:, n:] += form(2.5 * sizes * half**2)
    mean_square[:n, :n] += form(sizes * (0.625 * half**2 * h**2 + most_damping**2))
    # eps q.v <= eps (v.v/(2 f) + f q.q/2), f the lowest frequency
    f = float(system.omega.min())
    potential = stiffness + eps * damping + form(high)
    w_form = 0.5 * (1.0 + eps / f) * mean_square + 0.5 * to_q.T @ (potential + eps * f * eye) @ to_q
    stored = tables.sliders[:, 1] ** 2 / np.maximum(2.0 * tables.sliders[:, 0], 1e-300)
    # a hysteresis unloads with at least 2 k/(1 + gamma) if gamma is above 1, else with at least k
    slider_energy = float(np.sum(stored * np.maximum(0.5 * (1.0 + tables.bends[:, 2]), 1.0)))
    fixed = 2.0 * (1.0 + eps / f) * float(sizes @ strength**2) + float(np.sum(above)) + slider_energy
    nu = 0.5 * (1.0 + eps / f) * rest * float(b @ b)
    factor = np.linalg.inv(np.linalg.cholesky(s_form))
    mu = float(np.linalg.eigvalsh(factor @ w_form @ factor.T)[-1])
    rate = (1.0 - theta) / mu
    largest = float((g / rate + nu) * force**2 + constant / rate + fixed)
    quadratic = 0.5 * np.block([[eye, eps * eye], [eps * eye, stiffness + eps * damping + form(low)]])
    if np.linalg.eigvalsh(quadratic)[0] <= 0.0:
        return None
    return largest + float(np.sum(below)), rate, quadratic
