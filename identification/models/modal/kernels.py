"""Compiled slow flow of one nonlinear mode, integrated step by step."""

import numpy as np

from vibrolock.compiled import kernel

DONE = 0  # code: integrated to the end
DIVERGED = 1  # code: the amplitude exceeded the largest allowed


@kernel
def cubic(t: float, coefficients: np.ndarray, k: int) -> float:
    """Evaluate the cubic of interval k at t beyond the beginning of the interval."""
    return float(((coefficients[0, k] * t + coefficients[1, k]) * t + coefficients[2, k]) * t + coefficients[3, k])


@kernel
def inverse(z: complex) -> complex:
    """Return ``1 / z`` without protection against overflow, which takes most of the time of a compiled division."""
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@kernel
def modal_rate(
    q: complex,
    s: complex,
    drive: complex,
    change: complex,
    load: np.ndarray,
    breakpoints: np.ndarray,
    omega_of: np.ndarray,
    damping_of: np.ndarray,
    shape_of: np.ndarray,
    tail: np.ndarray,
) -> complex:
    """Return ``Q' = (phi (N - N' D'' / (2 G)) - D Q) / G``, ``G = D' - D D'' / (2 D')``, of the complex modal amplitude.

    ``D(s) = w^2 + 2 z w s + s^2 + phi^2 load[0]``; ``load`` [3] is the dynamic stiffness coupled to the drive point (N/m) and
    its first two derivatives with respect to s; ``drive`` is N (N), ``change`` its rate N' (N/s). The properties are those of
    `ModalProperties`.
    """
    size = np.sqrt(q.real * q.real + q.imag * q.imag)
    last = breakpoints[breakpoints.size - 1]
    if size > last:
        omega = np.sqrt(max(tail[0], tail[1] + tail[2] * (size * size - last * last)))
        damping = tail[3] + tail[4] * (size - last)
        phi = tail[5]
    else:
        k = 0
        while k < omega_of.shape[1] - 1 and breakpoints[k + 1] <= size:
            k += 1
        t = max(size - breakpoints[k], 0.0)
        omega, damping, phi = cubic(t, omega_of, k), cubic(t, damping_of, k), cubic(t, shape_of, k)
    loaded = phi * phi
    d0 = omega * omega + (2.0 * damping * omega + s) * s + loaded * load[0]
    d1 = 2.0 * (damping * omega + s) + loaded * load[1]
    half_d2 = 1.0 + 0.5 * loaded * load[2]
    per_slope = inverse(d1 - d0 * half_d2 * inverse(d1))
    return complex((phi * (drive - change * half_d2 * per_slope) - d0 * q) * per_slope)


@kernel
def slow_flow(
    start: complex,
    step_s: float,
    s: np.ndarray,
    drive: np.ndarray,
    change: np.ndarray,
    load: np.ndarray,
    breakpoints: np.ndarray,
    omega_of: np.ndarray,
    damping_of: np.ndarray,
    shape_of: np.ndarray,
    tail: np.ndarray,
    largest: float,
    out: np.ndarray,
    rate: np.ndarray,
) -> tuple[int, int]:
    """Integrate by classical Runge-Kutta steps over ``s``, ``drive``, ``change`` [2 n - 1] and ``load`` [2 n - 1, 3].

    A step ``step_s`` spans two intervals of the instants, so that every other instant serves as a midpoint. Fills ``out`` and
    ``rate`` [n]. Returns a code, `DIVERGED` if the amplitude exceeds ``largest``, and the number of filled entries.
    """
    q = start
    count = out.size
    for k in range(count):
        at = 2 * k
        k1 = modal_rate(q, s[at], drive[at], change[at], load[at], breakpoints, omega_of, damping_of, shape_of, tail)
        out[k] = q
        rate[k] = k1
        if not abs(q) <= largest:
            return DIVERGED, k + 1
        if k + 1 == count:
            break
        a, b = at + 1, at + 2
        k2 = modal_rate(
            q + 0.5 * step_s * k1, s[a], drive[a], change[a], load[a], breakpoints, omega_of, damping_of, shape_of, tail
        )
        k3 = modal_rate(
            q + 0.5 * step_s * k2, s[a], drive[a], change[a], load[a], breakpoints, omega_of, damping_of, shape_of, tail
        )
        k4 = modal_rate(
            q + step_s * k3, s[b], drive[b], change[b], load[b], breakpoints, omega_of, damping_of, shape_of, tail
        )
        q = q + step_s / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return DONE, count
