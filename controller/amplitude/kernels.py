"""Compiled amplitude laws on logarithms: alike at every level, and the voltage stays positive."""

import math

from vibrolock.compiled import kernel

LARGEST_ERROR = 1.0  # of a logarithm: a factor of e; beyond, the law hurries no further


@kernel
def log_ratio(wanted: float, measured: float) -> float:
    """``ln(wanted / measured)``, bounded; a level of nothing, or nothing measured, gives the bound."""
    if not measured > 0.0:
        return LARGEST_ERROR
    if not wanted > 0.0:
        return -LARGEST_ERROR
    return min(max(math.log(wanted / measured), -LARGEST_ERROR), LARGEST_ERROR)


@kernel
def log_proportional_integral(
    error: complex, integral: complex, kp: complex, ki: float, dt: float, lowest: float, highest: float, held: int
) -> tuple[float, float, complex]:
    """``ln U = kp E + ki int E`` with complex E, U and kp: returns (|U|, arg U, integral).

    |U| stays within ``lowest`` to ``highest``; while it stands at one the integral of the amplitude may only move away from
    there. ``held``: 1 while the output cannot rise to U as fast as it should, -1 while it cannot fall: the integral goes no
    further that way. The angle is never held.
    """
    step = error * (ki * dt)
    proposed = integral + step
    size = proposed.real + kp.real * error.real - kp.imag * error.imag
    angle = proposed.imag + kp.real * error.imag + kp.imag * error.real
    least, most = math.log(lowest), math.log(highest)
    grown = proposed.real
    if size > most or held > 0:
        grown = min(grown, integral.real)
    if size < least or held < 0:
        grown = max(grown, integral.real)
    return math.exp(min(max(size, least), most)), angle, complex(grown, proposed.imag)
