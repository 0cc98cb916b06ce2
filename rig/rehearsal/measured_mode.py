"""A measured nonlinear mode as springs and drag of a twin, and beyond what was measured, as uncertain as it is."""

from typing import Any

import numpy as np
import scipy

from identification import NonlinearMode
from rig.rehearsal.forces import drag, odd_polynomial
from rig.rehearsal.linear_rig import LinearRig
from vibrolock.arrays import Float

INSIDE = "inside"
LEAST_STD = 1e-4  # relative: smallest error of a measured frequency that is believed
LEAST_DAMPING_STD = 0.01
ENOUGH = 3.0  # standard errors, root mean square: misfit with which terms suffice


def elements_of(mode: NonlinearMode, rig: LinearRig, generator: np.random.Generator) -> list[dict[str, Any]]:
    """Return the elements with which the tested mode changes its frequency and damping over the amplitude as measured.

    The spring ``k3 x^3 + k5 x^5 + k7 x^7`` adds ``3/4 k3 a^2 + 5/8 k5 a^4 + 35/64 k7 a^6`` to the stiffness at amplitude a, the
    drag ``c2 |v| v + c3 v^3`` adds ``8/(3 pi) c2 v + 3/4 c3 v^2`` to the damping (their describing functions). Both are fitted
    to the levels by least squares, beside a constant, which the linear rig has already. How many terms a twin has is drawn from
    the numbers that fit: so twins differ beyond the highest level, where nothing was measured, and agree below. Drag does not
    go below zero: a damping that falls with the amplitude keeps its first value.
    """
    amplitude, shape = mode.amplitude_m, rig.of("drive_shape")
    omega = 2.0 * np.pi * mode.modal_frequency_hz
    stiffness = omega**2 / shape**2
    error = 2.0 * stiffness * np.maximum(_relative(mode, "modal_frequency_hz"), LEAST_STD)
    terms = np.stack([0.75 * amplitude**2, 0.625 * amplitude**4, 35.0 / 64.0 * amplitude**6], axis=1)
    table = [_user(odd_polynomial.__name__, "deflection", _drawn_fit(terms, stiffness, error, -np.inf, generator))]
    if np.all(np.isfinite(mode.damping_ratio)):
        damping = 2.0 * mode.damping_ratio * omega / shape**2
        error = damping * np.maximum(_relative(mode, "damping_ratio"), LEAST_DAMPING_STD)
        speed = omega * amplitude
        terms = np.stack([8.0 / (3.0 * np.pi) * speed, 0.75 * speed**2], axis=1)
        table.append(_user(drag.__name__, "velocity", _drawn_fit(terms, damping, error, 0.0, generator)))
    return table


def _relative(mode: NonlinearMode, quantity: str) -> Float:
    """Relative standard errors of a quantity [n]; 0 where they are unknown."""
    relative = np.asarray(mode.bound_95(quantity)) / 1.96 / np.abs(np.asarray(getattr(mode, quantity)))
    return np.asarray(np.nan_to_num(relative, nan=0.0, posinf=0.0))


def _drawn_fit(terms: Float, target: Float, error: Float, lowest: float, generator: np.random.Generator) -> list[float]:
    """Return coefficients of the first terms [n, m], as many as a draw among the numbers that fit says."""
    fits = []
    for count in range(1, min(terms.shape[1], target.size - 1) + 1):
        columns = np.column_stack([np.ones(target.size), terms[:, :count]]) / error[:, None]
        scale = np.max(np.abs(columns), axis=0)
        bounds = ([-np.inf, *[lowest] * count], np.inf)
        found = scipy.optimize.lsq_linear(columns / scale, target / error, bounds=bounds)
        fits.append((float(np.sqrt(2.0 * found.cost / target.size)), (found.x / scale)[1:].tolist()))
    chosen = generator.random()
    if not fits:
        return []
    good = [fit for misfit, fit in fits if misfit <= max(ENOUGH, ENOUGH * min(fits)[0])]
    return [float(value) for value in good[int(chosen * len(good))]]


def _user(name: str, of: str, parameters: list[float]) -> dict[str, Any]:
    padded = [*parameters, 0.0, 0.0, 0.0][:3]
    return {"kind": "user", "at": INSIDE, "of": of, "function": f"rig.rehearsal.forces:{name}", "parameters": padded}
