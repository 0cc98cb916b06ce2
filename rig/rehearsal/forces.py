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
    """Force of a spring: k3 x^3 + k5 x^5 + k7 x^7."""
    square = x * x
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
    coefficient = stiffness_n_m / (OF_POWER[power] * amplitude_m**power)
    if power == 2:
        return {"kind": "cubic", "at": at, "stiffness_n_m3": coefficient}
    return user_element(
        at, odd_polynomial.__name__, "deflection", [coefficient if power == each else 0.0 for each in OF_POWER]
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


def user_element(at: str, name: str, of: str, parameters: Sequence[float]) -> Element:
    """Return the table of an element with one of the force laws of this module."""
    return {"kind": "user", "at": at, "of": of, "function": f"{__name__}:{name}", "parameters": list(parameters)}
