"""The coupled rig in the time domain, started at rest under a voltage that is raised smoothly.

State [q, x_a, q', v_a, i]; with friction as rate equations the Jenkins forces follow. Three ways on purpose: DOP853
without friction, DOP853 with friction rates, and Runge-Kutta steps with the friction return map, memory committed once
per step.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from tests.reference.coupled_rig import CoupledRig
from vibrolock.arrays import Complex, Float

Derivative = Callable[[float, Float], Float]


class TimeDomain:
    """Right-hand sides and outputs of one rig under u = U cos(Omega t), U rising along a half cosine.

    A row of complex harmonics U_h, the mean first, gives u = Re sum U_h exp(i h Omega t).
    """

    def __init__(
        self, rig: CoupledRig, voltage_v: float | Complex, omega_rad_s: float, ramp_periods: float = 20.0
    ) -> None:
        self.rig, self.omega = rig, omega_rad_s
        self.voltages_v = np.array([0.0, voltage_v]) if np.ndim(voltage_v) == 0 else np.asarray(voltage_v)
        self.orders = np.arange(self.voltages_v.size)
        self.period_s = 2.0 * np.pi / omega_rad_s
        self.ramp_s = ramp_periods * self.period_s
        mass, damping, stiffness = rig.second_order
        n = rig.w_rad_s.size + 1
        inverse = 1.0 / np.diag(mass)
        self.mechanical, self.size = n, 2 * n + 1
        self.linear = np.zeros((self.size, self.size))
        self.linear[:n, n : 2 * n] = np.eye(n)
        self.linear[n:, :n] = -inverse[:, None] * stiffness[:, :n]
        self.linear[n:, n:] = -inverse[:, None] * damping
        self.into = np.zeros((self.size, 3))
        self.into[n:] = inverse[:, None] * rig.inputs
        pad = np.zeros(self.size - n + 1)
        self.z_row = np.r_[rig.phi_magnet, pad]
        self.delta_row = np.r_[rig.jenkins_c, pad]
        self.drive_row = np.r_[rig.phi_drive, pad]
        self.stuck = float(rig.jenkins_k.sum())
        self.limit = rig.jenkins_k * rig.jenkins_slip

    def voltage(self, t: float) -> float:
        rise = 1.0 if t >= self.ramp_s else 0.5 - 0.5 * np.cos(np.pi * t / self.ramp_s)
        return float(rise * np.real(self.voltages_v @ np.exp(1j * self.omega * t * self.orders)))

    def derivative(self, t: float, x: Float, jenkins: float = 0.0) -> Float:
        """x' under the given sum of Jenkins forces."""
        z, rig = float(self.z_row @ x), self.rig
        away = (rig.magnet_d0_m + z) if rig.symmetric else rig.magnet_d0_m
        magnet = rig.magnet_k0 * (away**-4 - (rig.magnet_d0_m - z) ** -4)
        friction = self.stuck * float(self.delta_row @ x) - jenkins
        return np.asarray(self.linear @ x + self.into @ np.array([magnet, friction, self.voltage(t)]))

    def derivative_with_rates(self, t: float, y: Float) -> Float:
        """State and Jenkins forces: f_j' = k_j delta', held at the limit while the motion pushes on."""
        x, f = y[: self.size], y[self.size :]
        speed = float(self.delta_row[: self.mechanical] @ x[self.mechanical : 2 * self.mechanical])
        pushing = f * np.sign(speed) >= self.limit
        return np.concatenate(
            [self.derivative(t, x, float(f.sum())), np.where(pushing, 0.0, self.rig.jenkins_k * speed)]
        )

    def force_n(self, x: Float) -> Float:
        """Stinger force from states (..., size)."""
        n = self.mechanical
        stretch = x[..., n - 1] - x @ self.drive_row
        rate = x[..., 2 * n - 1] - x[..., n : 2 * n - 1] @ self.rig.phi_drive
        return np.asarray(self.rig.stinger_k * stretch + self.rig.stinger_c * rate)

    def last_period(self, derivative: Derivative, extra: int, periods: int, samples: int = 128) -> Float:
        """DOP853 from rest over whole periods; states of the last one, shape (samples, size)."""
        t = (periods - 1 + np.arange(samples) / samples) * self.period_s
        solution = solve_ivp(
            derivative, (0.0, float(t[-1])), np.zeros(self.size + extra), "DOP853", t, rtol=1e-8, atol=1e-11
        )
        return np.asarray(solution.y[: self.size].T)

    def without_friction(self, periods: int) -> Float:
        """Settled period, clamp stuck (the rig must have no Jenkins stiffness), shape (samples, size)."""
        assert self.stuck == 0.0, "the rig has friction"
        return self.last_period(self.derivative, 0, periods)

    def with_friction_rates(self, periods: int) -> Float:
        """Settled period with Jenkins forces as states, shape (samples, size)."""
        return self.last_period(self.derivative_with_rates, self.limit.size, periods)

    def with_return_map(self, periods: int, steps: int = 384) -> Float:
        """Settled period by classical Runge-Kutta steps and the return map, shape (steps, size)."""
        h, k = self.period_s / steps, self.rig.jenkins_k
        x, force, kept = np.zeros(self.size), np.zeros(k.size), np.zeros((steps, self.size))

        def moved(to: Float) -> Float:
            trial = force + k * float(self.delta_row @ (to - x))
            return np.minimum(np.maximum(trial, -self.limit), self.limit)

        def slope(t: float, at: Float) -> Float:
            return self.derivative(t, at, float(moved(at).sum()))

        for step in range(periods * steps):
            kept[step % steps] = x
            t = step * h
            first = slope(t, x)
            second = slope(t + h / 2, x + h / 2 * first)
            third = slope(t + h / 2, x + h / 2 * second)
            last = slope(t + h, x + h * third)
            after = x + h / 6 * (first + 2 * second + 2 * third + last)
            force = moved(after)
            x = after
        return kept

    def harmonics(self, signal: Float) -> Complex:
        """Y_h of samples over one period, y = Re sum_h Y_h exp(i h theta), shape (samples // 2,)."""
        spectrum = np.fft.rfft(signal)[:-1] * (2.0 / signal.size)
        spectrum[0] *= 0.5
        return np.asarray(spectrum)
