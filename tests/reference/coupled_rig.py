"""The magnet-beam rig as plain equations: coil, armature, stinger, beam, magnets and clamp friction.

Written from the equations alone, so that agreement with the product's plant means something:

    q_i'' + 2 zeta_i w_i q_i' + w_i^2 q_i = phi_d,i F + phi_m,i f_magnet(z) + c_i f_friction(delta)
    F = k_s (x_a - x_d) + c_s (v_a - v_d),  m_a v_a' = G i - k_a x_a - c_a v_a - F,  L i' = u - R i - G v_a

with x_d = phi_d.q, z = phi_m.q, delta = c.q. Modes are those without magnets and with all friction stuck; the
friction sites therefore act minus their stuck stiffness.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vibrolock.arrays import Float

MAGNET_GAP_M = 0.011


@dataclass(frozen=True, eq=False)
class CoupledRig:
    """Numbers of one rig, SI units; modal vectors have shape (n,), Jenkins vectors (m,)."""

    w_rad_s: Float
    zeta: Float
    phi_drive: Float
    phi_magnet: Float
    phi_sensors: Mapping[str, Float]
    magnet_k0: float
    magnet_d0_m: float
    symmetric: bool
    jenkins_c: Float
    jenkins_k: Float
    jenkins_slip: Float
    stinger_k: float
    stinger_c: float
    armature_m: float
    armature_k: float
    armature_c: float
    coil_r: float
    coil_l: float
    motor_g: float

    def without_friction(self) -> "CoupledRig":
        """The same rig with its clamp stuck for good."""
        return replace(self, jenkins_k=np.zeros_like(self.jenkins_k))

    def without_magnets(self) -> "CoupledRig":
        """The same rig with the magnets taken off (their mass stays)."""
        return replace(self, magnet_k0=0.0)

    def magnet_force_n(self, z_m: Float) -> Float:
        """Whole magnet force, linear part included."""
        near = -self.magnet_k0 / (self.magnet_d0_m - z_m) ** 4
        far = self.magnet_d0_m + z_m if self.symmetric else self.magnet_d0_m
        return near + self.magnet_k0 / far**4

    def magnet_slope(self, z_m: Float) -> Float:
        """d f_magnet / dz, N/m."""
        slope = -4.0 * self.magnet_k0 / (self.magnet_d0_m - z_m) ** 5
        return slope - 4.0 * self.magnet_k0 / (self.magnet_d0_m + z_m) ** 5 if self.symmetric else slope

    @cached_property
    def linear_mode(self) -> tuple[float, float]:
        """First structural mode with the linear magnet stiffness: angular frequency (rad/s), |phi_drive| (kg^-1/2)."""
        k_lin = -float(self.magnet_slope(np.zeros(1))[0])
        squares, shapes = np.linalg.eigh(
            np.diag(self.w_rad_s**2) + k_lin * np.outer(self.phi_magnet, self.phi_magnet),
        )
        return float(np.sqrt(squares[0])), float(abs(self.phi_drive @ shapes[:, 0]))

    @cached_property
    def second_order(self) -> tuple[Float, Float, Float]:
        """Matrices M, C, K over [q, x_a, charge] (charge' = current), stinger and coil included, magnets not."""
        n = self.w_rad_s.size
        stretch = np.concatenate([-self.phi_drive, [1.0, 0.0]])
        ones = np.ones(n)
        mass = np.diag(np.concatenate([ones, [self.armature_m, self.coil_l]]))
        modal_damping = 2.0 * self.zeta * self.w_rad_s
        damping = np.diag(np.concatenate([modal_damping, [self.armature_c, self.coil_r]]))
        damping += self.stinger_c * np.outer(stretch, stretch)
        damping[n, n + 1] -= self.motor_g
        damping[n + 1, n] += self.motor_g
        stiffness = np.diag(np.concatenate([self.w_rad_s**2, [self.armature_k, 0.0]]))
        stiffness += self.stinger_k * np.outer(stretch, stretch)
        return mass, damping, stiffness

    @cached_property
    def inputs(self) -> Float:
        """Columns over [q, x_a, charge] of magnet force, friction force and voltage, shape (n + 2, 3)."""
        pad = [0.0, 0.0]
        voltage = np.zeros(self.w_rad_s.size + 2)
        voltage[-1] = 1.0
        return np.column_stack(
            [np.concatenate([self.phi_magnet, pad]), np.concatenate([self.jenkins_c, pad]), voltage],
        )


def parameters_from(document: Mapping[str, Any], specimen: int) -> CoupledRig:
    """Read one rig from a document with `mag` ("0" one-sided, "1" symmetric), `shaker` and `stinger`."""
    beam, shaker, stinger = document["mag"][str(specimen)], document["shaker"], document["stinger"]["mag"]
    shapes = {name: np.asarray(shape, dtype=np.float64) for name, shape in beam["phi"].items()}
    return CoupledRig(
        w_rad_s=np.asarray(beam["w"], dtype=np.float64),
        zeta=np.asarray(beam["z"], dtype=np.float64),
        phi_drive=shapes["drive"],
        phi_magnet=shapes["mag"],
        phi_sensors={name: shape for name, shape in shapes.items() if name not in ("drive", "mag")},
        magnet_k0=float(beam["K0"]),
        magnet_d0_m=MAGNET_GAP_M,
        symmetric=specimen == 1,
        jenkins_c=np.asarray(beam["c"], dtype=np.float64),
        jenkins_k=np.asarray(beam["k"], dtype=np.float64),
        jenkins_slip=np.asarray(beam["de"], dtype=np.float64),
        stinger_k=float(stinger["k"]),
        stinger_c=float(stinger["c"]),
        armature_m=float(shaker["ma"]),
        armature_k=float(shaker["ka"]),
        armature_c=float(shaker["ca"]),
        coil_r=float(shaker["R"]),
        coil_l=float(shaker["Lc"]),
        motor_g=float(shaker["G"]),
    )
