"""Compiled primitives of the control law, one sample a call.

Conventions: ``theta`` is the oscillator's phase in rad; a signal is ``y(t) = Re sum_h Y_h exp(i h theta)`` with peak
amplitudes; the phase lag of a response Y behind a force F is ``arg F_1 - arg Y_1``; the phase error is the wanted
lag minus the measured one, wrapped, positive below resonance, so that a positive error asks for a higher frequency.
"""

import math

from controller.layout import ACQUIRING, LOCKED, LOST, SEARCHING
from vibrolock.compiled import Record, kernel

TWO_PI = 2.0 * math.pi


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
def demodulate(estimate: complex, value: float, cos_theta: float, sin_theta: float, gain: float) -> complex:
    """Two-phase (synchronous) demodulation: low-passed ``2 y exp(-i theta)``, which settles on Y_1.

    Passes a ripple at 2 Omega of relative size a/(2 Omega), and harmonics h of y likewise at (h +- 1) Omega.
    """
    return complex(
        estimate.real + gain * (2.0 * value * cos_theta - estimate.real),
        estimate.imag + gain * (-2.0 * value * sin_theta - estimate.imag),
    )


@kernel
def size(value: complex) -> float:
    """Modulus of a complex amplitude; a plain root: the library's overflow-proof one costs a tenth of the sample."""
    return math.sqrt(value.real * value.real + value.imag * value.imag)


@kernel
def sign_product(force: float, acceleration: float) -> float:
    """Sign detector: sign(force) sign(displacement-like signal), the acceleration's sign reversed standing for displacement.

    For two sines its mean is ``(2/pi) e`` with the phase error e to phase resonance. Harmonics of either signal move
    the zero crossings and bias it.
    """
    if force == 0.0 or acceleration == 0.0:
        return 0.0
    return -1.0 if (force > 0.0) == (acceleration > 0.0) else 1.0


@kernel
def phase_lag(force: complex, response: complex) -> float:
    """Phase lag ``arg F_1 - arg Y_1`` in rad, in [-pi, pi)."""
    product = force * complex(response.real, -response.imag)
    return math.atan2(product.imag, product.real)


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
def next_lock_state(lock: Record, thresholds: Record, present: bool, held: bool, error: float) -> None:
    """Advance the lock state by one oscillator period, from the period's mean phase error (rad).

    ``present``: force and response stand above the smallest amplitudes that a phase can be read from.
    ``held``: the level is not being ramped; only then is a large error counted towards a lost lock.
    """
    size = abs(error)
    if not present:
        lock.close_periods = 0
        if lock.state == LOCKED:
            lock.far_periods += 1
            if lock.far_periods >= thresholds.lost_periods:
                lock.state = LOST
        elif lock.state != LOST:
            lock.state = SEARCHING
        return
    if lock.state == SEARCHING:
        lock.state = ACQUIRING
    lock.close_periods = lock.close_periods + 1 if size < thresholds.locked_rad else 0
    if size > thresholds.lost_rad and held:
        lock.far_periods += 1
    elif size > thresholds.lost_rad and lock.state == LOCKED:
        lock.state = ACQUIRING
    else:
        lock.far_periods = 0
    if lock.close_periods >= thresholds.locked_periods:
        lock.state = LOCKED
        lock.far_periods = 0
    elif lock.state == LOCKED and lock.far_periods >= thresholds.lost_periods:
        lock.state = LOST


@kernel
def reacquire(lock: Record) -> None:
    """A new level is being approached: a lost lock may be sought again."""
    lock.far_periods = 0
    lock.close_periods = 0
    lock.state = ACQUIRING
