"""Equations of the harmonic balance: residual and analytic Jacobian.

The linear part is condensed onto the two coordinates that carry nonlinear forces, z at the magnets and delta at the
clamp; the unknowns are their harmonics, the frequency and the voltage. Forces go through the time domain (alternating
frequency-time, Cameron and Griffin 1989), Jenkins memory over two periods.

Harmonics of the stinger force may be prescribed, F_h = c_h F_1^h / |F_1|^(h-1). There the structure alone is driven by the
force, and the voltage follows afterwards from armature and coil.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tests.reference.coupled_rig import CoupledRig
from tests.reference.friction import jenkins_over_a_period
from vibrolock.arrays import Complex, Float


@dataclass(frozen=True)
class Conditions:
    """What closes the equations: one of force and voltage, one of lag and frequency."""

    force_n: float | None = None
    voltage_v: float | None = None
    lag_deg: float | None = None
    omega_rad_s: float | None = None

    def __post_init__(self) -> None:
        if (self.force_n is None) == (self.voltage_v is None):
            raise ValueError("give exactly one of force_n and voltage_v")
        if (self.lag_deg is None) == (self.omega_rad_s is None):
            raise ValueError("give exactly one of lag_deg and omega_rad_s")

    @property
    def level(self) -> float:
        """Force or voltage, whichever is given."""
        return self.force_n if self.force_n is not None else self.voltage_v or 0.0

    def at_level(self, level: float) -> "Conditions":
        """The same with another force or voltage."""
        return replace(self, **{"voltage_v" if self.force_n is None else "force_n": level})


class Balance:
    """Residual and Jacobian over y = [z coefficients, delta coefficients, Omega, U].

    Coefficients are real: [Y_0, Re Y_1..H, Im Y_1..H], so that samples = basis @ coefficients.
    """

    def __init__(
        self, rig: CoupledRig, harmonics: int, samples: int, force_ratios: Mapping[int, complex] | None = None
    ) -> None:
        self.rig, self.harmonics, self.size = rig, harmonics, 2 * harmonics + 1
        self.force_ratios = dict(force_ratios or {})
        order = np.arange(1, harmonics + 1)
        angles = np.outer(2.0 * np.pi * np.arange(samples) / samples, order)
        self.basis = np.hstack([np.ones((samples, 1)), np.cos(angles), -np.sin(angles)])
        self.project = self.basis.T * (2.0 / samples)
        self.project[0] *= 0.5

    def transfer(self, omega: float) -> tuple[Complex, Complex]:
        """[z, delta, F, x_d] from [f_magnet, f_friction, u] and its derivative by Omega, shapes (H + 1, 4, 3)."""
        rig, n = self.rig, self.rig.w_rad_s.size
        mass, damping, stiffness = rig.second_order
        order = np.arange(self.harmonics + 1)
        s = (1j * omega * order)[:, None, None]
        first, slope = s * s * mass + s * damping + stiffness, 2.0 * s * mass + damping
        # the last unknown is taken as the current instead of the charge, which leaves s = 0 regular
        first[:, :, -1], slope[:, :, -1] = damping[:, -1] + s[:, :, 0] * mass[:, -1], mass[:, -1]
        solved = np.linalg.solve(first, np.broadcast_to(rig.inputs.astype(complex), (order.size, n + 2, 3)))
        stretch, pad = np.r_[-rig.phi_drive, 1.0, 0.0], np.zeros(2)
        rows = np.array([np.r_[rig.phi_magnet, pad], np.r_[rig.jenkins_c, pad], stretch, np.r_[rig.phi_drive, pad]])
        out = np.broadcast_to(rows.astype(complex), (order.size, 4, n + 2)).copy()
        out[:, 2] *= rig.stinger_k + s[:, :, 0] * rig.stinger_c
        out_slope = np.zeros_like(out)
        out_slope[:, 2] = rig.stinger_c * stretch
        by_s = out_slope @ solved - out @ np.linalg.solve(first, slope @ solved)
        value, by_omega = out @ solved, 1j * order[:, None, None] * by_s
        for h in self.force_ratios:
            value[h], by_omega[h] = self.driven_by_force(h, omega)
        return value, by_omega

    def driven_by_force(self, h: int, omega: float) -> tuple[Complex, Complex]:
        """Return [z, delta, F, x_d] from [f_magnet, f_friction, F] and its derivative by Omega, of the structure alone."""
        rig, s = self.rig, 1j * h * omega
        shapes = np.array([rig.phi_magnet, rig.jenkins_c, rig.phi_drive])
        modes = 1.0 / (s**2 + 2.0 * rig.zeta * rig.w_rad_s * s + rig.w_rad_s**2)
        by_omega = -(modes**2) * (2.0 * s + 2.0 * rig.zeta * rig.w_rad_s) * 1j * h
        values = [np.insert((shapes * m) @ shapes.T, 2, 0.0, axis=0) for m in (modes, by_omega)]
        values[0][2, 2] = 1.0
        return values[0], values[1]

    def voltages(self, omega: float, force: Complex, drive: Complex) -> Complex:
        """Return the voltages (H + 1,) of the prescribed harmonics of the force, 0 elsewhere, from armature and coil."""
        rig, voltages = self.rig, np.zeros(self.harmonics + 1, complex)
        for h in self.force_ratios:
            s = 1j * h * omega
            armature = drive[h] + force[h] / (rig.stinger_k + s * rig.stinger_c)
            inertia = rig.armature_m * s**2 + rig.armature_c * s + rig.armature_k
            current = (inertia * armature + force[h]) / rig.motor_g
            voltages[h] = (rig.coil_r + s * rig.coil_l) * current + rig.motor_g * s * armature
        return voltages

    def forces(self, y: Float) -> tuple[Float, Float, Float, Float]:
        """Coefficients of magnet and friction force and their Jacobians by the coefficients of z and delta."""
        z = self.basis @ y[: self.size]
        if np.max(np.abs(z)) >= 0.7 * self.rig.magnet_d0_m:
            raise ArithmeticError("the beam touches a magnet")
        delta = self.basis @ y[self.size : 2 * self.size]
        magnet, slope = self.rig.magnet_force_n(z), self.rig.magnet_slope(z)
        friction, tangent = jenkins_over_a_period(delta, self.basis, self.rig.jenkins_k, self.rig.jenkins_slip)
        p = self.project
        return p @ magnet, p @ friction, p @ (slope[:, None] * self.basis), p @ tangent

    def to_complex(self, coefficients: Float) -> Complex:
        """[Y_0, Re, Im] along the first axis to complex harmonics."""
        h = self.harmonics
        packed = coefficients[: h + 1].astype(complex)
        packed[1:] += 1j * coefficients[h + 1 :]
        return packed

    def to_real(self, harmonics: Complex) -> Float:
        """Inverse of `to_complex`."""
        return np.concatenate([harmonics.real, harmonics.imag[1:]])

    def unknowns(self, magnet_m: Complex, delta: Complex, omega_rad_s: float, voltage_v: float) -> Float:
        """Pack harmonics, frequency and voltage into y."""
        return np.concatenate([self.to_real(magnet_m), self.to_real(delta), [omega_rad_s, voltage_v]])

    def responses(self, y: Float) -> tuple[Complex, Complex]:
        """[z, delta, F, x_d] that the forces of y cause, (H + 1, 4), and Jacobian (H + 1, 4, len(y))."""
        p, h = self.size, self.harmonics
        transfer, by_omega = self.transfer(y[-2])
        magnet, friction, by_z, by_delta = self.forces(y)
        inputs = np.zeros((h + 1, 3), complex)
        inputs[:, 0], inputs[:, 1], inputs[1, 2] = self.to_complex(magnet), self.to_complex(friction), y[-1]
        slopes = np.zeros((h + 1, 3, y.size), complex)
        slopes[:, 0, :p], slopes[:, 1, p : 2 * p] = self.to_complex(by_z), self.to_complex(by_delta)
        slopes[1, 2, -1] = 1.0
        first = complex(transfer[1, 2] @ inputs[1])
        by_first = transfer[1, 2] @ slopes[1]
        by_first[-2] += by_omega[1, 2] @ inputs[1]
        size, by_size = abs(first), np.real(np.conj(first) * by_first) / abs(first)
        for h, ratio in self.force_ratios.items():
            inputs[h, 2] = ratio * first**h / size ** (h - 1)
            slopes[h, 2] = ratio * h * (first / size) ** (h - 1) * by_first - (h - 1) * inputs[h, 2] * by_size / size
        jacobian = transfer @ slopes
        jacobian[:, :, -2] += np.einsum("hoi,hi->ho", by_omega, inputs)
        return np.einsum("hoi,hi->ho", transfer, inputs), jacobian

    def residual(self, y: Float, conditions: Conditions) -> tuple[Float, Float]:
        """Balance of z and delta, then the two closing equations, shape (len(y),), and the Jacobian."""
        p = self.size
        response, slopes = self.responses(y)
        value, jacobian = np.empty_like(y), np.zeros((y.size, y.size))
        for at in (0, 1):
            part = slice(at * p, (at + 1) * p)
            value[part] = y[part] - self.to_real(response[:, at])
            jacobian[part] = -self.to_real(slopes[:, at])
            jacobian[part, part] += np.eye(p)
        force, drive = response[1, 2], response[1, 3]
        by_force, by_drive = slopes[1, 2], slopes[1, 3]
        if conditions.voltage_v is not None:
            value[-1], jacobian[-1, -1] = y[-1] - conditions.voltage_v, 1.0
        elif conditions.force_n is not None:
            value[-1] = abs(force) ** 2 / conditions.force_n**2 - 1.0
            jacobian[-1] = 2.0 * np.real(np.conj(force) * by_force) / conditions.force_n**2
        if conditions.omega_rad_s is not None:
            value[-2], jacobian[-2, -2] = y[-2] - conditions.omega_rad_s, 1.0
        elif conditions.lag_deg is not None:
            # arg F - arg X = lag + 180 deg
            turn = np.exp(-1j * np.radians(conditions.lag_deg + 180.0))
            value[-2] = np.angle(force * np.conj(drive) * turn)
            jacobian[-2] = np.imag(by_force / force) - np.imag(by_drive / drive)
        return value, jacobian
