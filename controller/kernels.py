"""Compiled primitives of every law, one sample a call: oscillator, low-pass, PI law with clamp.

Conventions: ``theta`` is the oscillator's phase in rad; a signal is ``y(t) = Re sum_h Y_h exp(i h theta)`` with peak
amplitudes; the phase lag of a response Y behind a force F is ``arg F_1 - arg Y_1``; the phase error is the wanted
lag minus the measured one, wrapped, positive below resonance, so that a positive error asks for a higher frequency.
"""

import math

from vibrolock.compiled import kernel

TWO_PI = 2.0 * math.pi
LARGEST_FREQUENCY_ERROR = 0.05  # of the frequency


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
def frequency_error(phase_error: float, compliance: float, omega: float, wanted_lag: float) -> float:
    """Distance (rad/s) of the oscillator from where a mode has the wanted lag: ``(Omega/2)(phi_d^2 |F|/|A|) sin e/|sin phi*|``.

    ``compliance`` is ``phi_d^2 |F_1|/|A_1|``, ``phase_error`` e the wanted lag phi* less the measured one. With
    ``phi_d^2 F/A = 1 - (w/Omega)^2 - 2 i zeta w/Omega`` and phi* = -90 deg it is ``w - Omega`` to first order: the slope of the
    phase over the frequency, which goes with the damping, is divided out. Bounded by a part of Omega.
    """
    bound = LARGEST_FREQUENCY_ERROR * omega
    error = 0.5 * omega * compliance * math.sin(phase_error) / abs(math.sin(wanted_lag))
    return float(min(max(error, -bound), bound))
