"""The coupled rig in the time domain, started at rest under a voltage that is raised smoothly.

State [q, x_a, q', v_a, i]; with friction as rate equations the Jenkins forces follow. Three ways on purpose: DOP853
without friction, DOP853 with friction rates, and Runge-Kutta steps with the friction return map, memory committed once
per step.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import ode

from tests.reference.coupled_rig import CoupledRig
from vibrolock.arrays import Complex, Float

Derivative = Callable[[float, Float], Float]


class Equations(NamedTuple):
    """What the right-hand side is made of."""

    linear: Float
    into: Float
    """Where magnet, friction and voltage enter, shape (size, 3)."""
    z_row: Float
    delta_row: Float
    voltages_v: Complex
    omega: float
    ramp_s: float
    magnet_k0: float
    magnet_d0_m: float
    symmetric: float
    stuck: float


@njit(cache=True)
def rates(t, x, jenkins, equations):
    """x' under the given sum of Jenkins forces."""
    linear, into, z_row, delta_row, voltages_v, omega, ramp_s, k0, d0, symmetric, stuck = equations
    rise = 1.0 if t >= ramp_s else 0.5 - 0.5 * np.cos(np.pi * t / ramp_s)
    voltage = 0.0
    for order in range(voltages_v.size):
        voltage += (voltages_v[order] * np.exp(1j * order * omega * t)).real
    z, delta = 0.0, 0.0
    for i in range(x.size):
        z += z_row[i] * x[i]
        delta += delta_row[i] * x[i]
    magnet = k0 * ((d0 + symmetric * z) ** -4 - (d0 - z) ** -4)
    friction = stuck * delta - jenkins
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = into[i, 0] * magnet + into[i, 1] * friction + into[i, 2] * rise * voltage
        for j in range(x.size):
            out[i] += linear[i, j] * x[j]
    return out


@njit(cache=True)
def moved(force, k, limit, delta_row, way):
    """Jenkins forces after a further way of the rig."""
    return np.minimum(np.maximum(force + k * np.sum(delta_row * way), -limit), limit)


@njit(cache=True)
def runge_kutta_with_return_map(kept, periods, h, k, limit, equations):
    """Fill ``kept`` with the states of the last period."""
    steps, delta_row = kept.shape[0], equations.delta_row
    x, force = np.zeros(kept.shape[1]), np.zeros(k.size)
    for step in range(periods * steps):
        kept[step % steps] = x
        t = step * h
        first = rates(t, x, force.sum(), equations)
        way = h / 2 * first
        second = rates(t + h / 2, x + way, moved(force, k, limit, delta_row, way).sum(), equations)
        way = h / 2 * second
        third = rates(t + h / 2, x + way, moved(force, k, limit, delta_row, way).sum(), equations)
        way = h * third
        last = rates(t + h, x + way, moved(force, k, limit, delta_row, way).sum(), equations)
        way = h / 6 * (first + 2 * second + 2 * third + last)
        force = moved(force, k, limit, delta_row, way)
        x = x + way


class TimeDomain:
    """Right-hand sides and outputs of one rig under u = U cos(Omega t), U rising along a half cosine.

    A row of complex harmonics U_h, the mean first, gives u = Re sum U_h exp(i h Omega t).
    """

    def __init__(
        self, rig: CoupledRig, voltage_v: float | Complex, omega_rad_s: float, ramp_periods: float = 20.0
    ) -> None:
        self.rig = rig
        self.period_s = 2.0 * np.pi / omega_rad_s
        mass, damping, stiffness = rig.second_order
        n = rig.w_rad_s.size + 1
        inverse = 1.0 / np.diag(mass)
        self.mechanical, self.size = n, 2 * n + 1
        linear, into = np.zeros((self.size, self.size)), np.zeros((self.size, 3))
        linear[:n, n : 2 * n] = np.eye(n)
        linear[n:, :n] = -inverse[:, None] * stiffness[:, :n]
        linear[n:, n:] = -inverse[:, None] * damping
        into[n:] = inverse[:, None] * rig.inputs
        pad = np.zeros(self.size - n + 1)
        self.delta_row = np.r_[rig.jenkins_c, pad]
        self.drive_row = np.r_[rig.phi_drive, pad]
        self.stuck = float(rig.jenkins_k.sum())
        self.limit = rig.jenkins_k * rig.jenkins_slip
        self.equations = Equations(
            linear=linear,
            into=into,
            z_row=np.r_[rig.phi_magnet, pad],
            delta_row=self.delta_row,
            voltages_v=np.array([0.0, voltage_v] if np.ndim(voltage_v) == 0 else voltage_v, np.complex128),
            omega=float(omega_rad_s),
            ramp_s=float(ramp_periods * self.period_s),
            magnet_k0=float(rig.magnet_k0),
            magnet_d0_m=float(rig.magnet_d0_m),
            symmetric=float(rig.symmetric),
            stuck=self.stuck,
        )

    def derivative(self, t: float, x: Float) -> Float:
        """x' where nothing rubs."""
        return np.asarray(rates(t, x, 0.0, self.equations))

    def derivative_with_rates(self, t: float, y: Float) -> Float:
        """State and Jenkins forces: f_j' = k_j delta', held at the limit while the motion pushes on."""
        x, f = y[: self.size], y[self.size :]
        speed = float(self.delta_row[: self.mechanical] @ x[self.mechanical : 2 * self.mechanical])
        pushing = f * np.sign(speed) >= self.limit
        return np.concatenate(
            [rates(t, x, f.sum(), self.equations), np.where(pushing, 0.0, self.rig.jenkins_k * speed)]
        )

    def force_n(self, x: Float) -> Float:
        """Stinger force from states (..., size)."""
        n = self.mechanical
        stretch = x[..., n - 1] - x @ self.drive_row
        rate = x[..., 2 * n - 1] - x[..., n : 2 * n - 1] @ self.rig.phi_drive
        return np.asarray(self.rig.stinger_k * stretch + self.rig.stinger_c * rate)

    def last_period(self, derivative: Derivative, extra: int, periods: int, samples: int = 128) -> Float:
        """DOP853 from rest over whole periods; states of the last one, shape (samples, size)."""
        solver = ode(derivative).set_integrator("dop853", rtol=1e-8, atol=1e-11, nsteps=10**7)
        solver.set_initial_value(np.zeros(self.size + extra), 0.0)
        t = (periods - 1 + np.arange(samples) / samples) * self.period_s
        states = np.array([solver.integrate(one) for one in t])
        assert solver.successful()
        return states[:, : self.size]

    def without_friction(self, periods: int) -> Float:
        """Settled period, clamp stuck (the rig must have no Jenkins stiffness), shape (samples, size)."""
        assert self.stuck == 0.0, "the rig has friction"
        return self.last_period(self.derivative, 0, periods)

    def with_friction_rates(self, periods: int) -> Float:
        """Settled period with Jenkins forces as states, shape (samples, size)."""
        return self.last_period(self.derivative_with_rates, self.limit.size, periods)

    def with_return_map(self, periods: int, steps: int = 384) -> Float:
        """Settled period by classical Runge-Kutta steps and the return map, shape (steps, size)."""
        kept = np.zeros((steps, self.size))
        h = self.period_s / steps
        runge_kutta_with_return_map(kept, periods, h, self.rig.jenkins_k, self.limit, self.equations)
        return kept

    def harmonics(self, signal: Float) -> Complex:
        """Y_h of samples over one period, y = Re sum_h Y_h exp(i h theta), shape (samples // 2,)."""
        spectrum = np.fft.rfft(signal)[:-1] * (2.0 / signal.size)
        spectrum[0] *= 0.5
        return np.asarray(spectrum)
