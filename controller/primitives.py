"""Compiled primitives of every law: oscillator, low-pass, PI laws with clamp.

Conventions of the whole package: ``theta`` is the oscillator's phase in rad. A signal is ``y(t) = Re sum_h Y_h exp(i h theta)``
with peak amplitudes. The phase lag of a response Y behind a force F is ``arg F_1 - arg Y_1``. The phase error is the wanted
lag minus the measured lag, wrapped; it is positive below resonance, so that a positive error asks for a higher frequency.
"""

import math

from vibrolock.compiled import kernel

TWO_PI = 2.0 * math.pi  # rad in a turn
LARGEST_ERROR = 1.0  # of a logarithm: a factor of e; a larger error counts as this one


@kernel
def wrap(angle: float) -> float:
    """Return an angle in rad wrapped into [-pi, pi)."""
    return angle - TWO_PI * math.floor((angle + math.pi) / TWO_PI)


@kernel
def advance_phase(theta: float, omega: float, dt: float) -> float:
    """Return the oscillator's phase one sample later, in [0, 2 pi)."""
    theta = theta + omega * dt
    if theta >= TWO_PI:
        theta -= TWO_PI
    return theta


@kernel
def track(mean: float, value: float, gain: float) -> float:
    """Return the next output of a first-order low-pass a/(s + a), exact for a held input: ``gain = 1 - exp(-a dt)``."""
    return mean + gain * (value - mean)


@kernel
def size(value: complex) -> float:
    """Return the modulus of a complex amplitude by a plain square root.

    The library's overflow-proof modulus would cost a tenth of the computing time of a sample.
    """
    return math.sqrt(value.real * value.real + value.imag * value.imag)


@kernel
def proportional_integral(
    error: float, integral: float, kp: float, ki: float, dt: float, centre: float, lowest: float, highest: float
) -> tuple[float, float]:
    """Evaluate a PI law with clamp; return (output, integral).

    Anti-windup by conditional integration: while the output is at a bound, the integral may only move away from it.
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
    """Return ``ln(wanted / measured)`` within +-`LARGEST_ERROR`; the bound itself if either value is not above zero."""
    if not measured > 0.0:
        return LARGEST_ERROR
    if not wanted > 0.0:
        return -LARGEST_ERROR
    return min(max(math.log(wanted / measured), -LARGEST_ERROR), LARGEST_ERROR)


@kernel
def log_proportional_integral(
    error: complex, integral: complex, kp: complex, ki: float, dt: float, lowest: float, highest: float, held: int
) -> tuple[float, float, complex]:
    """Evaluate ``ln U = kp E + ki int E`` with complex E, U and kp; return (|U|, arg U, integral).

    On logarithms a gain has the same effect at every level, and |U| stays positive. |U| stays within ``lowest`` to ``highest``;
    while |U| is at a bound, the real part of the integral may only move away from that bound. ``held``: 1 while the output
    cannot rise to U as fast as demanded, -1 while it cannot fall as fast; the real part of the integral does not move further
    in that direction. The imaginary part, which gives the angle, is never held.
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
