"""A measured nonlinear mode as springs and drag of a twin, and beyond what was measured, as uncertain as it is."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from identification import NonlinearMode
from rig.rehearsal.forces import drag, odd_polynomial
from rig.rehearsal.linear_rig import LinearRig

__all__ = ["elements_of"]

Real = NDArray[np.float64]

INSIDE = "inside"
LEAST_STD = 1e-4  # relative: smallest error of a measured frequency that is believed


def elements_of(mode: NonlinearMode, rig: LinearRig, generator: np.random.Generator) -> list[dict[str, Any]]:
    """Return the elements with which the tested mode has the measured frequency and damping over the amplitude.

    The spring ``k3 x^3 + k5 x^5 + k7 x^7`` adds ``3/4 k3 a^2 + 5/8 k5 a^4 + 35/64 k7 a^6`` to the stiffness at amplitude a, the
    drag ``c2 |v| v + c3 v^3`` adds ``8/(3 pi) c2 v + 3/4 c3 v^2`` to the damping (their describing functions). Both are fitted
    to the levels by least squares; the measured values are drawn within their standard errors. Beyond the highest level the
    polynomials go on as they are. Drag does not go below zero: a damping that falls with the amplitude keeps its first value.
    """
    amplitude = mode.amplitude_m
    shape = rig.of("drive_shape")
    omega = 2.0 * np.pi * mode.modal_frequency_hz * np.exp(_drawn(mode, "modal_frequency_hz", generator, LEAST_STD))
    linear = 2.0 * np.pi * rig.of("frequency_hz")
    stiffness = (omega**2 - linear**2) / shape**2
    columns = np.stack([0.75 * amplitude**2, 0.625 * amplitude**4, 35.0 / 64.0 * amplitude**6], axis=1)
    spring = _fitted(columns[:, : min(3, amplitude.size)], stiffness, -np.inf)
    table: list[dict[str, Any]] = [_user(odd_polynomial.__name__, "deflection", [*spring, 0.0, 0.0][:3])]
    ratio = mode.damping_ratio * np.exp(_drawn(mode, "damping_ratio", generator, LEAST_STD))
    if np.all(np.isfinite(ratio)):
        damping = 2.0 * (ratio * omega - rig.of("damping_ratio") * linear) / shape**2
        speed = omega * amplitude
        columns = np.stack([8.0 / (3.0 * np.pi) * speed, 0.75 * speed**2], axis=1)
        table.append(_user(drag.__name__, "velocity", _fitted(columns[:, : min(2, speed.size)], damping, 0.0)))
    return table


def _drawn(mode: NonlinearMode, quantity: str, generator: np.random.Generator, least: float) -> Real:
    """Draw relative errors of a quantity [n], within its 95 % bound, the same for all levels."""
    values = np.asarray(getattr(mode, quantity))
    relative = np.nan_to_num(np.asarray(mode.bound_95(quantity)) / 1.96 / np.abs(values), nan=0.0, posinf=0.0)
    return np.asarray(np.maximum(relative, least) * generator.standard_normal())


def _fitted(columns: Real, target: Real, lowest: float) -> list[float]:
    scale = np.max(np.abs(columns), axis=0)
    found = lsq_linear(columns / scale, target, bounds=(lowest, np.inf)).x / scale
    return [float(value) for value in found]


def _user(name: str, of: str, parameters: list[float]) -> dict[str, Any]:
    padded = [*parameters, 0.0, 0.0, 0.0][:3]
    return {"kind": "user", "at": INSIDE, "of": of, "function": f"rig.rehearsal.forces:{name}", "parameters": padded}
