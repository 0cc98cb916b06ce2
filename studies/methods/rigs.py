"""The six rigs of the race: levels, benches with noise or drift, and the truth by harmonic balance."""

from functools import cache
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from rig.bench import Bench, load_bench
from rig.drivers.virtual.driver import VirtualDAQ
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from vibrolock.arrays import Float

SHIPPED = ("magnet-beam", "magnet-beam-symmetric", "friction-beam")
RIGS = (*SHIPPED, "cubic-beam", "stop-beam", "joint-beam")
FORCES_N = {
    "magnet-beam": (0.026, 0.56),
    "magnet-beam-symmetric": (0.026, 0.56),
    "friction-beam": (0.1, 16.6),
    "cubic-beam": (0.05, 1.0),
    "stop-beam": (0.05, 1.0),
    "joint-beam": (0.25, 5.0),
}
"""Range of the backbone: fundamental of the force at phase resonance, N. That of the shipped rigs is the paper's."""
LEVELS = 13
CONDITIONS: dict[str, dict[str, Any]] = {
    "1 x noise": {},
    "10 x noise": {"noise_scale": 10.0},
    "drift": {"wear": {"frequency_per_s": [-0.001 / 60.0], "until_s": 6000.0}},
}
"""Options of the virtual rig. ``drift``: all natural frequencies fall by 0.1 % of themselves per minute."""
CONTROLLED = 7
"""Highest harmonic of the force that is controlled, in tests with ``pure`` force and in their truth."""
NEAR = np.array([-0.01, -0.003, 0.0, 0.003, 0.01])  # around a level, in the logarithm of the amplitude


def _own(length_m: float, damping: float, part: dict[str, Any]) -> dict[str, Any]:
    """Return a bench with a clamped steel beam, 40 x 8 mm, shaker at 40 % of its length, and a nonlinear part at its tip."""
    sensors: list[dict[str, Any]] = [
        {"name": "force", "kind": "force", "sensitivity_v_per_unit": 0.1, "range_v": 5.0, "noise_rms": 0.0005},
        {"name": "drive", "at": "drive", "sensitivity_v_per_unit": 0.01, "range_v": 5.0, "noise_rms": 0.002},
        {"name": "tip", "at": "tip", "sensitivity_v_per_unit": 0.01, "range_v": 5.0, "noise_rms": 0.002},
    ]
    roles = {"force": ("force", "N"), "drive": ("drive", "m/s^2"), "tip": ("response", "m/s^2")}
    options: dict[str, Any] = {
        "structure": {
            "kind": "beam",
            "boundary": "clamped-free",
            "length_m": length_m,
            "width_m": 0.040,
            "thickness_m": 0.008,
            "youngs_modulus_pa": 210e9,
            "density_kg_m3": 7850.0,
            "damping_ratio": [damping, 0.002, 0.002],
            "points_m": {"drive": 0.4 * length_m, "tip": length_m},
        },
        "elements": [],
        "friction": [],
        "exciter": {
            "armature_mass_kg": 0.18,
            "suspension_stiffness_n_m": 6000.0,
            "suspension_damping_n_s_m": 12.0,
            "force_factor_n_a": 5.3,
            "resistance_ohm": 1.5,
            "inductance_h": 150e-6,
        },
        "stinger": {"at": "drive", "stiffness_n_m": 5e6, "damping_n_s_m": 30.0},
        "sensors": [{"kind": "acceleration"} | sensor for sensor in sensors],
    }
    joint = part["kind"] in ("jenkins", "iwan")
    options["friction" if joint else "elements"].append({"at": "tip"} | part)
    rig = VirtualRig.model_validate(options)
    hertz = float(rig.linear_modes.frequency_hz[0])
    return {
        "sample_rate_hz": 5000.0,
        "output_range_v": 10.0,
        "driver": {"name": "virtual", "options": options},
        "specimen": {
            "name": part["kind"],
            "linear_frequency_hz": hertz,
            "drive_mode_shape": abs(float(rig.linear_modes.drive_shape[0])),
        },
        "limits": {
            "voltage_v": 9.0,
            "force_n": 35.0,
            "acceleration_m_s2": 400.0,
            "displacement_m": 0.008,
            "frequency_hz": [0.4 * hertz, 12.0 * hertz],
        },
        "channels": [
            {"name": sensor["name"], "role": roles[sensor["name"]][0], "unit": roles[sensor["name"]][1]}
            | {key: sensor[key] for key in ("sensitivity_v_per_unit", "range_v", "noise_rms")}
            for sensor in sensors
        ],
    }


OWN = {
    "cubic-beam": (0.50, 0.002, {"kind": "cubic", "stiffness_n_m3": 4e7}),
    "stop-beam": (0.35, 0.003, {"kind": "clearance", "gap_m": 3e-4, "contact_stiffness_n_m": 6000.0}),
    "joint-beam": (
        0.30,
        0.002,
        {"kind": "iwan", "stiffness_n_m": 8000.0, "phi_max_m": 8e-4, "chi": -0.3, "beta": 0.3, "n_element": 12},
    ),
}
"""Rigs of one's own: length (m), damping ratio of the first mode, nonlinear part."""


@cache
def bench_of(rig: str, condition: str = "1 x noise") -> Bench:
    """Return the bench of a rig under a condition."""
    table = load_bench(rig).model_dump() if rig in SHIPPED else {"name": rig, **_own(*OWN[rig])}
    table["driver"]["options"] = table["driver"]["options"] | CONDITIONS[condition]
    return Bench.model_validate(table)


def _virtual(rig: str) -> VirtualRig:
    return VirtualDAQ(bench_of(rig)).rig


def truth_at(rig: str, pure: bool, amplitudes_m: Float) -> tuple[Float, Float]:
    """Return modal frequency (Hz) and damping ratio at amplitudes, by harmonic balance of the unworn coupled rig.

    ``pure``: harmonics 2 to 7 of the force are zero; else the voltage is a sine. Raises `NotConvergedError`.
    """
    levels = np.array(levels_of(rig, pure)[1])
    if np.all(np.min(np.abs(np.log(amplitudes_m[:, None] / levels)), axis=1) < NEAR[-1]):
        grid, frequency, damping = _near_levels(rig, pure)
        at = np.log(amplitudes_m / grid[0])
        curves = [PchipInterpolator(np.log(grid / grid[0]), values) for values in (frequency, damping)]
        return np.asarray(curves[0](at)), np.asarray(curves[1](at))
    order = np.argsort(amplitudes_m)
    back = np.argsort(order)
    frequency, damping = _balanced(rig, pure, amplitudes_m[order])
    return frequency[back], damping[back]


@cache
def _near_levels(rig: str, pure: bool) -> tuple[Float, Float, Float]:
    """Return the truth at and closely around the levels, between which interpolation costs nothing."""
    levels = np.array(levels_of(rig, pure)[1])
    grid = np.sort(np.outer(levels, np.exp(NEAR)).ravel())
    return grid, *_balanced(rig, pure, grid)


def _balanced(rig: str, pure: bool, rising_m: Float) -> tuple[Float, Float]:
    found = phase_resonance_backbone(_virtual(rig), amplitudes_m=rising_m, force_harmonics=CONTROLLED if pure else None)
    return found.modal_frequency_hz, found.damping_ratio


@cache
def levels_of(rig: str, pure: bool) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Return the levels of a backbone: forces (N), amplitudes (m) and voltages (V)."""
    low, high = FORCES_N[rig]
    forces = np.geomspace(low, high, LEVELS)
    found = phase_resonance_backbone(_virtual(rig), forces_n=forces, force_harmonics=CONTROLLED if pure else None)
    rounded = [
        tuple(float(f"{value:.5g}") for value in values) for values in (forces, found.amplitude_m, found.voltage_v)
    ]
    return rounded[0], rounded[1], rounded[2]
