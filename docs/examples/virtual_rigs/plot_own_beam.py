"""
A beam of one's own with a force law of one's own
=================================================

A cantilever of steel with air drag at its tip, written as a compiled function of the velocity. The drag takes energy in
proportion to the cube of the amplitude: the damping ratio rises in a straight line.
"""

import math

import matplotlib.pyplot as plt
import numba

from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone


@numba.cfunc("float64(float64, CPointer(float64))")
def drag(velocity_m_s, parameters):
    """Force against the velocity, growing with its square, N."""
    return -parameters[0] * velocity_m_s * abs(velocity_m_s)


B = 0.5  # N s^2/m^2
beam = {
    "kind": "beam",
    "boundary": "clamped-free",
    "length_m": 0.5,
    "width_m": 0.04,
    "thickness_m": 0.008,
    "youngs_modulus_pa": 210e9,
    "density_kg_m3": 7850.0,
    "damping_ratio": [0.002],
    "points_m": {"drive": 0.2, "tip": 0.5},
}
shaker = {
    "armature_mass_kg": 0.18,
    "suspension_stiffness_n_m": 6000.0,
    "suspension_damping_n_s_m": 12.0,
    "force_factor_n_a": 5.3,
    "resistance_ohm": 1.5,
    "inductance_h": 150e-6,
}
rig = VirtualRig.model_validate(
    {
        "structure": beam,
        "elements": [{"kind": "user", "at": "tip", "of": "velocity", "function": drag, "parameters": [B]}],
        "exciter": shaker,
        "stinger": {"at": "drive", "stiffness_n_m": 5e6, "damping_n_s_m": 30.0},
        "sensors": [{"name": "force", "kind": "force", "sensitivity_v_per_unit": 0.1, "range_v": 5.0}],
    }
)

# %%
# The first mode against the closed form of a clamped beam, and the backbone by harmonic balance. In one mode the drag adds
# ``4 b phi**3 q / (3 pi)`` to the damping ratio, with the mode shape ``phi`` at the tip and the modal amplitude q.

modes = rig.linear_modes
speed, radius = math.sqrt(210e9 / 7850.0), 0.008 / math.sqrt(12.0)
closed_hz = 1.875104**2 / (2 * math.pi) * speed * radius / 0.5**2
print(f"{modes.frequency_hz[0]:.3f} Hz by finite elements, {closed_hz:.3f} Hz by the closed form")

found = phase_resonance_backbone(rig, amplitudes_m=[1e-4, 3e-4, 6e-4, 1e-3, 1.5e-3])
tip = modes.at(rig.shape("tip"))[0]
one_mode = modes.damping_ratio[0] + 4 * B * abs(tip) ** 3 * found.modal_amplitude / (3 * math.pi)

figure, axis = plt.subplots(figsize=(6, 3.8), layout="constrained")
axis.plot(1e3 * found.amplitude_m, 100 * found.damping_ratio, "o", label="harmonic balance of the rig")
axis.plot(1e3 * found.amplitude_m, 100 * one_mode, label="closed form, one mode")
axis.set(xlabel="displacement of the drive point, mm", ylabel="modal damping ratio, %")
axis.legend()
plt.show()
