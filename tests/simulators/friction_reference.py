"""Independent reference for a rig whose joints slip: Jenkins forces as rate equations, by scipy's DOP853."""

import numpy as np
from scipy.integrate import DOP853

from simulators.virtual_rig import VirtualRig

RTOL = 1e-9
ATOL_STATE = 1e-13
ATOL_FORCE_N = 1e-9


class SlippingEquations:
    """Equations of motion of a rig without elements, term by term from the configuration; joints do not yet act on it.

    Every Jenkins force is a state, ``f_j' = k_j delta'``, held at its limit while the motion pushes on. DOP853 finds the
    corners by itself: a step across one fails its error estimate and is cut.
    """

    def __init__(self, rig: VirtualRig) -> None:
        e, s, m = rig.exciter, rig.stinger, rig.structure.omega_rad_s.size
        self.n_mode, self.n_state = m, 2 * m + 3
        drive = rig.shape(s.at)
        self.rows = np.array(
            [rig.plant.signs * rig.structure.shape(joint.at, joint.quantity) for joint in rig.friction]
        )
        assert not any(joint.relative_to_mode_1 for joint in rig.friction)
        self.site = np.repeat(np.arange(len(rig.friction)), [len(joint.stiffness) for joint in rig.friction])
        self.stiffness = np.concatenate([joint.stiffness for joint in rig.friction])
        self.limit_n = self.stiffness * np.concatenate([joint.slip for joint in rig.friction])
        self.force_row = np.concatenate(
            [-s.stiffness_n_m * drive, -s.damping_n_s_m * drive, [s.stiffness_n_m, s.damping_n_s_m, 0.0]]
        )
        # The modes are those with the joints stuck: the joints' own stiffness is taken off, for their forces are states.
        stuck = np.bincount(self.site, self.stiffness)
        omega = rig.structure.omega_rad_s
        linear = np.zeros((self.n_state, self.n_state))
        linear[:m, m : 2 * m] = np.eye(m)
        linear[m : 2 * m] = np.outer(drive, self.force_row)
        linear[m : 2 * m, :m] += self.rows.T @ (stuck[:, None] * self.rows) - np.diag(omega**2)
        linear[m : 2 * m, m : 2 * m] -= np.diag(2 * np.array(rig.structure.damping_ratio) * omega)
        armature = np.zeros(self.n_state)
        armature[2 * m :] = -e.suspension_stiffness_n_m, -e.suspension_damping_n_s_m, e.force_factor_n_a
        linear[2 * m, 2 * m + 1] = 1.0
        linear[2 * m + 1] = (armature - self.force_row) / e.armature_mass_kg
        linear[2 * m + 2, 2 * m + 1 :] = -e.force_factor_n_a / e.inductance_h, -e.resistance_ohm / e.inductance_h
        self.linear, self.per_volt = linear, e.amplifier_gain / e.inductance_h

    def __call__(self, y: np.ndarray, voltage: float) -> np.ndarray:
        m = self.n_mode
        x, f = y[: self.n_state], y[self.n_state :]
        rates = self.linear @ x
        rates[-1] += self.per_volt * voltage
        rates[m : 2 * m] -= self.rows.T @ np.bincount(self.site, f)
        speed = (self.rows @ x[m : 2 * m])[self.site]
        slipping = (np.abs(f) >= self.limit_n) & (f * speed > 0.0)
        return np.concatenate([rates, np.where(slipping, 0.0, self.stiffness * speed)])

    def solve(self, voltages: np.ndarray, dt_s: float) -> np.ndarray:
        """States [n, n_state] at the beginning of every sample, with each voltage held."""
        y, out = np.zeros(self.n_state + self.site.size), []
        atol = np.repeat([ATOL_STATE, ATOL_FORCE_N], [self.n_state, self.site.size])
        changes = np.flatnonzero(np.diff(voltages, prepend=np.nan))
        for first, last in zip(changes, [*changes[1:], voltages.size], strict=True):
            voltage, k = float(voltages[first]), 0
            solver = DOP853(lambda _, y, u=voltage: self(y, u), 0.0, y, (last - first) * dt_s, rtol=RTOL, atol=atol)
            while solver.status == "running":
                solver.step()
                dense = solver.dense_output()
                while k * dt_s <= solver.t and k < last - first:
                    out.append(dense(k * dt_s)[: self.n_state])
                    k += 1
            y = solver.y
        return np.array(out)
