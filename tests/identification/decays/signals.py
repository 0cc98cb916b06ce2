"""Decays whose modal properties are known in closed form, or by harmonic balance of one equation."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.special import ellipk

from identification import Channel

DRIVE = (Channel("drive", "drive", "m"),)
FREQUENCY_HZ = 20.0
OMEGA = 2.0 * np.pi * FREQUENCY_HZ
_ORDERS = np.array([1, 3, 5, 7])
_COSINES = np.cos(np.outer(2.0 * np.pi * np.arange(64) / 64, _ORDERS))


def linear(damping, seconds, rate_hz, amplitude=1.0, frequency_hz=FREQUENCY_HZ, phase=0.3):
    """Displacement of a linear oscillator, exactly."""
    omega, t = 2.0 * np.pi * frequency_hz, np.arange(int(seconds * rate_hz)) / rate_hz
    turning = omega * np.sqrt(1.0 - damping**2)
    return amplitude * np.exp(-damping * omega * t) * np.cos(turning * t + phase)


def hardening(damping, seconds, rate_hz, start_m=0.6):
    """Displacement and acceleration of ``x'' + 2 z w x' + w^2 (x + x^3) = 0`` from rest, by DOP853."""

    def slope(_, y):
        return [y[1], -2.0 * damping * OMEGA * y[1] - OMEGA**2 * (y[0] + y[0] ** 3)]

    t = np.arange(int(seconds * rate_hz)) / rate_hz
    x, v = solve_ivp(slope, (0.0, t[-1]), [start_m, 0.0], "DOP853", t, rtol=1e-11, atol=1e-14).y
    return x, -2.0 * damping * OMEGA * v - OMEGA**2 * (x + x**3)


def hardening_frequency_hz(fundamental_m):
    """Frequency of the free undamped vibration by the fundamental's amplitude: four harmonics balanced."""

    def residual(unknowns, amplitude):
        parts = np.array([amplitude, *unknowns[1:]])
        x = _COSINES @ parts
        force = 2.0 * np.mean(_COSINES * (x + x**3)[:, None], axis=0)
        return force - _ORDERS**2 * unknowns[0] * parts

    squares = [fsolve(residual, [1.0 + 0.75 * a * a, 0, 0, 0], a, xtol=1e-13)[0] for a in np.atleast_1d(fundamental_m)]
    return FREQUENCY_HZ * np.sqrt(squares)


def hardening_by_elliptic_integral(start_m):
    """Frequency (Hz) and fundamental (m) of the free undamped vibration from rest at ``start_m``, in closed form.

    ``x = X cn(s t, k)``, s^2 = w^2 (1 + X^2), k^2 = X^2 / (2 (1 + X^2)); the nome gives the Fourier coefficients of cn.
    """
    m = start_m**2 / (2.0 * (1.0 + start_m**2))
    quarter = ellipk(m)
    nome = np.exp(-np.pi * ellipk(1.0 - m) / quarter)
    fundamental = start_m * 2.0 * np.pi / (np.sqrt(m) * quarter) * np.sqrt(nome) / (1.0 + nome)
    return OMEGA * np.sqrt(1.0 + start_m**2) / (4.0 * quarter), fundamental


def rubbing(damping, friction_m, seconds, rate_hz, start_m=1.0):
    """Displacement of ``x'' + 2 z w x' + w^2 (x + d sign x') = 0`` from rest: exact between the turning points."""
    turning, t = OMEGA * np.sqrt(1.0 - damping**2), np.arange(int(seconds * rate_hz)) / rate_hz
    half = np.pi / turning
    x, before = np.empty(t.size), start_m
    passed = np.floor(t / half).astype(int)
    for k in range(passed[-1] + 1):
        centre = friction_m if k % 2 == 0 else -friction_m
        now, away = passed == k, before - centre
        if abs(before) <= friction_m:
            x[passed >= k] = before
            break
        ago = t[now] - k * half
        x[now] = centre + away * np.exp(-damping * OMEGA * ago) * (
            np.cos(turning * ago) + damping * OMEGA / turning * np.sin(turning * ago)
        )
        before = centre - away * np.exp(-damping * OMEGA * half)
    return x
