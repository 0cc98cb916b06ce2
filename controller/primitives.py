"""Compiled primitives of every law: oscillator, low-pass, PI laws with clamp.

Conventions of the whole package: ``theta`` is the oscillator's phase in rad; a signal is ``y(t) = Re sum_h Y_h exp(i h theta)``
with peak amplitudes; the phase lag of a response Y behind a force F is ``arg F_1 - arg Y_1``; the phase error is the wanted
lag minus the measured one, wrapped, positive below resonance, so that a positive error asks for a higher frequency.
"""

import math

from vibrolock.compiled import kernel

TWO_PI = 2.0 * math.pi
LARGEST_ERROR = 1.0  # of a logarithm: a factor of e; a larger error counts as this one


@kernel
def wrap(angle: float) -> float:
    """Angle in rad brought into [-pi, pi)."""
    return angle - TWO_PI * math.floor((angle + math.pi) / TWO_PI)


@kernel
def advance_phase(theta: float, omega: float, dt: float) -> float:
    """Oscillator: the phase one sample on, in [0, 2 pi)."""
    theta = theta + omega * dt
    if theta >= TWO_PI:
        theta -= TWO_PI
    return theta


@kernel
def track(mean: float, value: float, gain: float) -> float:
    """First-order low-pass a/(s + a), exact for a held input: ``gain = 1 - exp(-a dt)``."""
    return mean + gain * (value - mean)


@kernel
def size(value: complex) -> float:
    """Modulus of a complex amplitude; a plain root: the library's overflow-proof one costs a tenth of the sample."""
    return math.sqrt(value.real * value.real + value.imag * value.imag)


@kernel
def proportional_integral(
    error: float, integral: float, kp: float, ki: float, dt: float, centre: float, lowest: float, highest: float
) -> tuple[float, float]:
    """PI law with clamp: returns (output, integral).

    Anti-windup by conditional integration: while the output stands at a bound, the integral may only move away from it.
    """
    step = ki * error * dt
    output = centre + kp * error + integral + step
    if output > highest:
        return highest, integral + min(step, 0.0)
    if output < lowest:
        return lowest, integral + max(step, 0.0)
    return output, integral + step


@kernel
def log_ratio(wanted: float, measured: float) -> float:
    """``ln(wanted / measured)``, bounded; a level of zero, or nothing measured, gives the bound."""
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

    On logarithms a gain means the same at every level, and U stays positive. |U| stays within ``lowest`` to ``highest``; while
    it stands at one, the integral of the amplitude may only move away from there. ``held``: 1 while the output cannot rise to U
    as fast as it should, -1 while it cannot fall: the integral goes no further that way. The angle is never held.
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
