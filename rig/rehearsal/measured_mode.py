"""A measured nonlinear mode as springs and dampers of a twin, and beyond what was measured, as uncertain as it is."""

import numpy as np
import scipy

from identification import NonlinearMode
from rig.rehearsal.forces import (
    OF_POWER,
    Element,
    polynomial_spring,
    spring_through,
    user_element,
    velocity_damping,
)
from rig.rehearsal.linear.model import LinearRig
from vibrolock.arrays import Float

INSIDE = "inside"
"""Point of a twin whose deflection is that of the structure itself, without its motion on the suspension."""
MIN_STD, MIN_DAMPING_STD = 1e-4, 0.01
"""Smallest relative errors of a measured frequency and damping ratio that are believed; chosen: what settled points repeat."""
MAX_MISFIT = 3.0  # root-mean-square misfit of a fit that suffices, in standard errors or over the best fit's; chosen
_COEFFICIENTS = 3  # coefficients of a user element's law


def elements_of(mode: NonlinearMode, rig: LinearRig, generator: np.random.Generator) -> list[Element]:
    """Return the elements with which the tested mode changes its frequency and damping over the amplitude as measured.

    The spring ``k3 x^3 + k5 x^5 + k7 x^7`` adds ``3/4 k3 a^2 + 5/8 k5 a^4 + 35/64 k7 a^6`` to the stiffness at amplitude a, the
    damper ``c2 |v| v + c3 v^3`` adds ``8/(3 pi) c2 v + 3/4 c3 v^2`` to the damping (their describing functions). Both are
    fitted to the levels by least squares, beside a constant, which the linear rig has already. The number of terms of a twin
    is drawn from those that fit, so twins agree up to the highest level and differ beyond it, where nothing was measured. The
    damping coefficients are not negative: a damping that falls with the amplitude keeps its first value. A stiffness that no
    such spring has, as with a stop, is that of a piecewise linear spring whose slope changes at the measured amplitudes.
    """
    amplitude, shape = mode.amplitude_m, rig.of("drive_shape")
    omega = 2.0 * np.pi * mode.modal_frequency_hz
    stiffness = omega**2 / shape**2
    error = 2.0 * stiffness * np.maximum(_relative(mode, "modal_frequency_hz"), MIN_STD)
    highest = float(amplitude.max())
    terms = np.stack([part * (amplitude / highest) ** power for power, part in OF_POWER.items()], axis=1)
    spring, misfit = _sampled_fit(terms, stiffness, error, -np.inf, generator)
    elements = [polynomial_spring(INSIDE, spring, highest)]
    if misfit > MAX_MISFIT:
        elements = [spring_through(INSIDE, amplitude, stiffness - stiffness[0])]
    if np.all(np.isfinite(mode.damping_ratio)):
        damping = 2.0 * mode.damping_ratio * omega / shape**2
        error = damping * np.maximum(_relative(mode, "damping_ratio"), MIN_DAMPING_STD)
        speed = omega * amplitude
        terms = np.stack([8.0 / (3.0 * np.pi) * speed, 0.75 * speed**2], axis=1)
        damper, _ = _sampled_fit(terms, damping, error, 0.0, generator)
        elements.append(user_element(INSIDE, velocity_damping.__name__, "velocity", damper))
    return elements


def _relative(mode: NonlinearMode, quantity: str) -> Float:
    """Relative standard errors of a quantity [n]; 0 where they are unknown."""
    relative = np.asarray(mode.bound_95(quantity)) / 1.96 / np.abs(np.asarray(getattr(mode, quantity)))
    return np.asarray(np.nan_to_num(relative, nan=0.0, posinf=0.0))


def _sampled_fit(
    terms: Float, target: Float, error: Float, lowest: float, generator: np.random.Generator
) -> tuple[list[float], float]:
    """Return the three coefficients of a fit, and the least misfit; how many are not 0 is drawn from the fits that do well."""
    fits = []
    for count in range(1, min(terms.shape[1], target.size - 1) + 1):
        columns = np.column_stack([np.ones(target.size), terms[:, :count]]) / error[:, None]
        scale = np.max(np.abs(columns), axis=0)
        bounds = ([-np.inf, *[lowest] * count], np.inf)
        found = scipy.optimize.lsq_linear(columns / scale, target / error, bounds=bounds)
        fits.append((float(np.sqrt(2.0 * found.cost / target.size)), (found.x / scale)[1:].tolist()))
    chosen = generator.random()
    if not fits:
        return [0.0] * _COEFFICIENTS, 0.0
    least = min(fits)[0]
    good = [fit for misfit, fit in fits if misfit <= max(MAX_MISFIT, MAX_MISFIT * least)]
    return [*good[int(chosen * len(good))], *[0.0] * _COEFFICIENTS][:_COEFFICIENTS], least
