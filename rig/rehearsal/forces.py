"""Force laws of the hypothesised nonlinearities, as elements of a virtual rig, and what they do to one mode.

Under a displacement ``x = a cos(theta)`` a force ``-f(x)`` acts on the fundamental like a stiffness, its describing function
``N(a) = 1/(pi a) integral of f(a cos theta) cos theta`` (Gelb and Vander Velde, Multiple-Input Describing Functions, 1968).
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from vibrolock.arrays import Float
from vibrolock.content_cache import c_function

SAMPLES = 720  # samples of a period in a describing function; chosen: exact for harmonics up to some hundreds
cfunction = c_function("float64(float64, CPointer(float64))")
"""Compiles a force law as `simulators.sites.elements.User` wants it."""
BOUND = 0.5  # displacement at which a softening spring begins to stop softening, over the highest one; chosen
OF_POWER = {2: 3.0 / 4.0, 4: 5.0 / 8.0, 6: 35.0 / 64.0}
"""Describing function of ``x^(p + 1)`` at unit amplitude, by the power p."""
TABLE_REACH, TABLE_NODES = 1.5, 129
"""Deflection that a table reaches over the largest amplitude, and its nodes on either side; chosen: 1 % of it apart."""
Element = dict[str, object]
"""Table of an element of a virtual rig, as in its file."""


@cfunction
def saturating(x: float, parameters: Sequence[float]) -> float:
    """Force of a cubic spring whose secant stiffness is bounded: k3 x^3 / (1 + (x / x0)^2)."""
    ratio = x / parameters[1]
    return -parameters[0] * x * x * x / (1.0 + ratio * ratio)


@cfunction
def velocity_damping(v: float, parameters: Sequence[float]) -> float:
    """Damping force that grows with the velocity: (c2 |v| + c3 v^2) v."""
    return -(parameters[0] * abs(v) + parameters[1] * v * v) * v


drag = velocity_damping
"""Name of the same law in twins that earlier versions have written."""


@cfunction
def odd_polynomial(x: float, parameters: Sequence[float]) -> float:
    """Force of a spring: k3 x^3 + k5 x^5 + k7 x^7. Twins that earlier versions have written use it."""
    square = x * x
    return -(parameters[0] + (parameters[1] + parameters[2] * square) * square) * square * x


@cfunction
def scaled_polynomial(x: float, parameters: Sequence[float]) -> float:
    """Force of a spring with stiffnesses that add up at a displacement a: (k3 (x/a)^2 + k5 (x/a)^4 + k7 (x/a)^6) x.

    Coefficients of the seventh power of metres would exceed what an element takes where amplitudes are micrometres.
    """
    ratio = x / parameters[3]
    square = ratio * ratio
    return -(parameters[0] + (parameters[1] + parameters[2] * square) * square) * square * x


def describing_function(force: Callable[[Float], Float], amplitude: float) -> float:
    """Return N(a) of ``force(x)``, the restoring force, by a sum over a period."""
    theta = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    cosine = np.cos(theta)
    return float(2.0 / (SAMPLES * amplitude) * np.sum(force(amplitude * cosine) * cosine))


def hardening_for(at: str, stiffness_n_m: float, amplitude_m: float, power: int = 2) -> Element:
    """Return a spring that adds a stiffness (N/m) at an amplitude (m), which grows by a power of it.

    A force ``k3 x^3`` adds ``3/4 k3 a^2``, ``k5 x^5`` adds ``5/8 k5 a^4``, and ``k7 x^7`` adds ``35/64 k7 a^6``.
    """
    if power == 2:
        return {"kind": "cubic", "at": at, "stiffness_n_m3": stiffness_n_m / (OF_POWER[2] * amplitude_m**2)}
    return polynomial_spring(
        at, [stiffness_n_m / OF_POWER[each] if power == each else 0.0 for each in OF_POWER], amplitude_m
    )


def softening_for(at: str, stiffness_n_m: float, amplitude_m: float) -> Element:
    """Return a spring with bounded secant stiffness that adds a stiffness (N/m, negative to soften) at an amplitude (m)."""
    bound = BOUND * amplitude_m
    of_unit = describing_function(lambda x: x**3 / (1.0 + (x / bound) ** 2), amplitude_m)
    return user_element(at, saturating.__name__, "deflection", [stiffness_n_m / of_unit, bound])


def damping_for(at: str, damping_n_s_m: float, velocity_m_s: float) -> Element:
    """Return a damper that adds a damping (N s/m) at a velocity amplitude (m/s): ``8/(3 pi) c2 v`` for ``c2 |v| v``."""
    return user_element(
        at, velocity_damping.__name__, "velocity", [damping_n_s_m * 3.0 * math.pi / (8.0 * velocity_m_s), 0.0]
    )


def polynomial_spring(at: str, stiffnesses_n_m: Sequence[float], amplitude_m: float) -> Element:
    """Return a spring of force ``(k3 (x/a)^2 + k5 (x/a)^4 + k7 (x/a)^6) x``, with k in N/m at the amplitude a (m)."""
    return user_element(at, scaled_polynomial.__name__, "deflection", [*stiffnesses_n_m, amplitude_m])


def spring_through(at: str, amplitudes_m: Float, stiffness_n_m: Float) -> Element:
    """Return a spring that adds a stiffness (N/m) at each of some rising amplitudes (m), and none below the first.

    Its force is piecewise linear: behind a gap g a slope k adds ``k (1 - 2/pi (asin r + r sqrt(1 - r^2)))`` with r = g/a at
    amplitudes above g (Gelb and Vander Velde, 1968), and each measured amplitude is the gap of what the next one shows.
    """
    gaps = amplitudes_m[:-1]
    ratio = np.minimum(gaps[None, :] / amplitudes_m[1:, None], 1.0)
    added = 1.0 - 2.0 / math.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
    slopes = np.linalg.solve(added, stiffness_n_m[1:])
    half = np.linspace(0.0, TABLE_REACH * amplitudes_m[-1], TABLE_NODES)
    force = np.maximum(half[:, None] - gaps, 0.0) @ slopes
    return {
        "kind": "force-table",
        "at": at,
        "deflection_m": [*-half[:0:-1], *half],
        "force_n": [*-force[:0:-1], *force],
    }


def user_element(at: str, name: str, of: str, parameters: Sequence[float]) -> Element:
    """Return the table of an element with one of the force laws of this module."""
    return {"kind": "user", "at": at, "of": of, "function": f"{__name__}:{name}", "parameters": list(parameters)}
