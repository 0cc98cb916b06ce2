"""Derivatives of the responses of the linear rig by its parameters, in closed form.

With the receptance r of the drive point, ``F = g_e V / D``, ``D = 1 + Z (r + 1/k_s)``, where `rig.rehearsal.linear.model`
explains the symbols; a response is ``s^2 r_c F``.
"""

from collections.abc import Sequence

import numpy as np

from rig.rehearsal.linear.model import LinearRig, Responses
from vibrolock.arrays import Complex, Float


def weighted_slopes(rig: LinearRig, names: Sequence[str], responses: Responses, weight: Float) -> Float:
    """Return the slopes by the named parameters over standard deviations: real parts above imaginary ones [2 n outputs, p]."""
    by_name = slopes(rig, responses.frequency_hz, responses.sample_rate_hz)
    out = np.stack([(by_name[name] / weight).ravel() for name in names], axis=1)
    return np.concatenate([out.real, out.imag])


def slopes(rig: LinearRig, frequency_hz: Float, sample_rate_hz: float) -> dict[str, Complex]:
    """Return the derivatives of `LinearRig.responses` by parameter [n, 2 + responses].

    Those of ratios and of the delay are by the parameter itself, all others by its logarithm.
    """
    s: Complex = 2j * np.pi * np.asarray(frequency_hz, np.complex128)
    value = rig.responses(frequency_hz, sample_rate_hz)
    force, receptances = value[:, 0], rig.receptances(s)
    stiffness = rig.dynamic_stiffness(s)
    compliance = receptances[0] + 1.0 / rig.values["stinger_stiffness_n_m"]
    denominator = 1.0 + stiffness * compliance
    out = {
        name: value * relative[:, None]
        for name, relative in _of_the_shaker(rig, s, stiffness, compliance, denominator).items()
    }
    for name, change in _of_the_modes(rig, s).items():
        of_force = -stiffness / denominator * change[0] * force
        of_responses = s**2 * (change * force + receptances * of_force)
        out[name] = np.asarray(np.vstack([of_force, of_responses]).T)
    return out


def _of_the_shaker(
    rig: LinearRig, s: Complex, stiffness: Complex, compliance: Complex, denominator: Complex
) -> dict[str, Complex]:
    """Relative changes of force and responses by the parameters of shaker, stinger and converters [n]."""
    v = rig.values
    late = s * v["coil_time_constant_s"]
    lag = 1.0 + late
    half, corner = 0.5 * v["exciter_damping_n_s_m"], 2.0 * np.pi * v["coupling_hz"]
    by_stiffness = -compliance / denominator
    return {
        "force_per_volt_n_v": np.ones_like(s),
        "coil_time_constant_s": -late / lag - by_stiffness * s * half * late / lag**2,
        "moving_mass_kg": by_stiffness * s**2 * v["moving_mass_kg"],
        "exciter_damping_n_s_m": by_stiffness * s * half * (1.0 + 1.0 / lag),
        "suspension_stiffness_n_m": by_stiffness * v["suspension_stiffness_n_m"],
        "stinger_stiffness_n_m": stiffness / (v["stinger_stiffness_n_m"] * denominator),
        "delay_s": -s,
        "coupling_hz": -corner / (s + corner),
    }


def _of_the_modes(rig: LinearRig, s: Complex) -> dict[str, Complex]:
    """Changes of the receptances by the parameters of the modes [1 + responses, n], m/N."""
    out: dict[str, Complex] = {}
    for mode in rig.modes:
        end = f" {mode}" if mode else ""
        omega, shape = 2.0 * np.pi * rig.of("frequency_hz", mode), rig.of("drive_shape", mode)
        damped = 2.0 * rig.of("damping_ratio", mode) * omega * s
        pole = s**2 + damped + omega**2
        of_the_drive_point = shape * shape / pole
        ratios = np.array([1.0, *(rig.of(f"ratio {name}", mode) for name in rig.channels)])
        part: Complex = ratios[:, None] * of_the_drive_point
        out[f"drive_shape{end}"] = 2.0 * part
        out[f"damping_ratio{end}"] = -part * damped / pole
        out[f"frequency_hz{end}"] = -part * (damped + 2.0 * omega**2) / pole
        for row, name in enumerate(rig.channels, 1):
            out[f"ratio {name}{end}"] = np.zeros_like(part)
            out[f"ratio {name}{end}"][row] = of_the_drive_point
    return out
