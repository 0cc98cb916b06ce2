"""Independent references for the virtual rig: equations of motion written out, and scipy's DOP853."""

from typing import Any

import numpy as np
from scipy.integrate import DOP853

from simulators.virtual_rig import VirtualRig

UNFILTERED: dict[str, Any] = {"oversampling": 1, "anti_alias_hz": 0.0, "reconstruction_hz": 0.0}
"""Changes to a converter that leave it without the filters of the shipped rigs."""


def ideal(specimen: str = "magnet-beam", **changes: Any) -> VirtualRig:
    """A specimen with nothing between physics and samples: no noise, no quantisation, no filter, no limits."""
    table = VirtualRig.shipped(specimen).model_dump()
    for sensor in table["sensors"]:
        sensor |= {"noise_rms": 0.0, "high_pass_hz": 0.0, "sensitivity_v_per_unit": 1.0, "range_v": 1e9}
    table["converter"] |= {"adc_bits": 0, "dac_bits": 0, "adc_range_v": 1e9, "dac_range_v": 1e9} | UNFILTERED
    for key, value in changes.items():
        table[key] = table[key] | value if isinstance(value, dict) else value
    return VirtualRig.model_validate(table)


class EquationsOfMotion:
    """Right-hand side of the frictionless rig, term by term from the configuration, the whole magnet force included."""

    def __init__(self, rig: VirtualRig) -> None:
        self.exciter, self.stinger, self.elements = rig.exciter, rig.stinger, rig.elements
        self.omega = rig.structure.omega_rad_s
        self.zeta = np.array(rig.structure.damping_ratio)
        self.drive = rig.shape(rig.stinger.at)
        self.rows = [rig.shape(element.at) for element in rig.elements]

    def stinger_force_n(self, x: np.ndarray) -> float:
        m = self.omega.size
        stretch, rate = x[2 * m] - self.drive @ x[:m], x[2 * m + 1] - self.drive @ x[m : 2 * m]
        return float(self.stinger.stiffness_n_m * stretch + self.stinger.damping_n_s_m * rate)

    def magnet_force_n(self, k: int, z: float) -> float:
        strength, gap = self.elements[k].strength_n_m4, self.elements[k].gap_m
        if self.elements[k].one_sided:
            return -strength / (gap - z) ** 4 + strength / gap**4
        return -strength / (gap - z) ** 4 + strength / (gap + z) ** 4

    def __call__(self, x: np.ndarray, voltage: float) -> np.ndarray:
        m, e = self.omega.size, self.exciter
        q, v, x_a, v_a, i = x[:m], x[m : 2 * m], x[2 * m], x[2 * m + 1], x[2 * m + 2]
        force = self.stinger_force_n(x)
        acceleration = self.drive * force - 2 * self.zeta * self.omega * v - self.omega**2 * q
        for k, row in enumerate(self.rows):
            acceleration = acceleration + row * self.magnet_force_n(k, float(row @ q))
        suspension = e.suspension_stiffness_n_m * x_a + e.suspension_damping_n_s_m * v_a
        armature = (e.force_factor_n_a * i - suspension - force) / e.armature_mass_kg
        coil = (voltage - e.resistance_ohm * i - e.force_factor_n_a * v_a) / e.inductance_h
        return np.concatenate([v, acceleration, [v_a, armature, coil]])

    def solve(self, voltages: np.ndarray, dt_s: float) -> np.ndarray:
        """States [n, n_state] at the beginning of every sample, with each voltage held, at rtol 1e-10."""
        state, states = np.zeros(2 * self.omega.size + 3), []
        changes = np.flatnonzero(np.diff(voltages, prepend=np.nan))
        for first, last in zip(changes, [*changes[1:], voltages.size], strict=True):
            voltage, span = float(voltages[first]), (last - first) * dt_s
            solver = DOP853(lambda _, x, u=voltage: self(x, u), 0.0, state, span, rtol=1e-10, atol=1e-13)
            instants = iter(range(last - first))
            k = next(instants)
            while solver.status == "running":
                solver.step()
                dense = solver.dense_output()
                while k * dt_s <= solver.t and k < last - first:
                    states.append(dense(k * dt_s))
                    k += 1
            state = solver.y
        return np.array(states)
