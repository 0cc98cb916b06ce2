"""The detector: estimates the complex amplitudes of force and acceleration from samples, and from them the phase error."""

import math
from enum import IntEnum
from typing import Literal

import numpy as np
from pydantic import Field

from controller.adaptive_filter import MOST_HARMONICS, adapt, root_mean_square, turn_phasors
from controller.primitives import size, track, wrap
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel, kernel
from vibrolock.errors import InputError


class Detector(IntEnum):
    """Method that estimates the complex amplitudes of force and response, and the phase error."""

    TWO_PHASE = 0
    """Synchronous demodulation through a first-order low-pass."""
    SIGN = 1
    """Product of the signs of force and response; amplitudes as with `TWO_PHASE`."""
    ADAPTIVE = 2
    """Adaptive filter: estimates the mean and several harmonics at once."""


SIGN, ADAPTIVE = int(Detector.SIGN), int(Detector.ADAPTIVE)
KINDS = {"two-phase": Detector.TWO_PHASE, "sign": Detector.SIGN, "adaptive": Detector.ADAPTIVE}

DETECTOR = record(i8="kind harmonics", f8="gain mean_gain")
"""Parameters of the detector (one record): its `Detector`, and the number of harmonics of the adaptive filter. ``gain`` is the
step of the low-pass after the demodulation, ``mean_gain`` the step of the low-pass that follows the mean of an input."""

DETECTOR_STATE = record(
    ("phasors", "c16", (MOST_HARMONICS + 1,)),
    ("force_filter", "c16", (MOST_HARMONICS + 1,)),
    ("drive_filter", "c16", (MOST_HARMONICS + 1,)),
    f8="sign_mean force_square",
)
"""State of the detector (one record). Only the first H+1 entries of the three complex arrays are used."""

VIBRATION = record(
    i8="present",
    f8="force_n drive_m_s2 displacement_m force_rms_n error_rad rest_force_n rest_drive_m_s2 rest_error_rad",
    c16="force drive",
)
"""Measured vibration at one sample (one record). Detector and rest estimate write it; the laws read it.

``force``, ``drive``: complex fundamentals of the force (N) and of the drive point's acceleration (m/s^2). ``force_n``,
``drive_m_s2``, ``displacement_m``: amplitudes of the fundamentals. ``force_rms_n``: RMS of all harmonics of the force, where
a law holds it. ``present``: whether force and acceleration exceed the smallest amplitudes whose phase can be read.
``error_rad``: phase error. ``rest_``: amplitudes and phase error expected once the vibration is steady
(`controller.rest`)."""


class DetectorSettings(Settings):
    """How force and response are demodulated."""

    detector: Literal["two-phase", "sign", "adaptive"] = "two-phase"
    """``two-phase`` (reading B of the paper's controller), ``sign`` (reading A) or ``adaptive``: an adaptive filter, which
    removes harmonics and mean and can therefore be ten times as fast."""
    low_pass_rad_s: float = Field(2.0 * math.pi, gt=0, le=1e4)
    """a, w_LP: corner of the demodulation's first-order low-pass, rad/s."""
    harmonics_followed: int = Field(5, ge=1, le=MOST_HARMONICS)
    """Harmonics that the adaptive filter follows; higher ones appear as ripple of the phase."""
    mean_corner_hz: float = Field(0.3, gt=0, le=100)
    """Corner of the high-pass that removes the mean from every input before it is demodulated, Hz."""

    def build_detector(self, sample_rate_hz: float) -> np.ndarray:
        """One record of `DETECTOR`; ValueError where the filter is too quick for the sample rate."""
        dt = 1.0 / sample_rate_hz
        gain = -math.expm1(-self.low_pass_rad_s * dt)
        if self.detector == "adaptive" and gain * (2 * self.harmonics_followed + 1) > 1.0:
            largest = -math.log1p(-1.0 / (2 * self.harmonics_followed + 1)) / dt
            reason = (
                f"an adaptive filter with {self.harmonics_followed} harmonics at {sample_rate_hz:g} samples/s "
                f"allows up to {largest:.4g}"
            )
            raise InputError(reason, field="low_pass_rad_s", value=self.low_pass_rad_s)
        out = np.zeros(1, DETECTOR)
        out["kind"] = KINDS[self.detector]
        out["harmonics"] = self.harmonics_followed
        out["gain"] = gain
        out["mean_gain"] = -math.expm1(-2.0 * math.pi * self.mean_corner_hz * dt)
        return out


@kernel
def demodulate(estimate: complex, value: float, cos_theta: float, sin_theta: float, gain: float) -> complex:
    """Return the two-phase (synchronous) demodulation: low-passed ``2 y exp(-i theta)``, which settles on Y_1.

    The estimate keeps a ripple at 2 Omega of relative size a/(2 Omega). A harmonic h of y causes ripple at (h +- 1) Omega.
    """
    return complex(
        estimate.real + gain * (2.0 * value * cos_theta - estimate.real),
        estimate.imag + gain * (-2.0 * value * sin_theta - estimate.imag),
    )


@kernel
def sign_product(force: float, acceleration: float) -> float:
    """Return sign(force) times sign(displacement); the reversed sign of the acceleration stands for that of the displacement.

    For two sines the mean of the product is ``(2/pi) e`` with the phase error e from phase resonance. Harmonics of either
    signal move the zero crossings and bias the mean.
    """
    if force == 0.0 or acceleration == 0.0:
        return 0.0
    return -1.0 if (force > 0.0) == (acceleration > 0.0) else 1.0


@kernel
def phase_lag(force: complex, response: complex) -> float:
    """Return the phase lag ``arg F_1 - arg Y_1`` in rad, in [-pi, pi)."""
    product = force * complex(response.real, -response.imag)
    return math.atan2(product.imag, product.real)


@inner_kernel
def detect(
    parameters: Record, state: Record, vibration: Record, force: float, drive: float, phasor: complex, omega: float
) -> None:
    """Update the fundamentals in ``vibration`` with one sample of force (N) and acceleration (m/s^2), both without mean.

    ``phasor`` is ``exp(i theta)`` with the oscillator's phase at the output when the sample was taken. ``omega`` is the
    oscillator's frequency (rad/s).
    """
    gain = parameters.gain
    if parameters.kind == ADAPTIVE:
        harmonics = parameters.harmonics
        turn_phasors(state.phasors, harmonics, phasor.real, phasor.imag)
        adapt(state.force_filter, state.phasors, harmonics, force, gain)
        adapt(state.drive_filter, state.phasors, harmonics, drive, gain)
        vibration.force, vibration.drive = state.force_filter[1], state.drive_filter[1]
    else:
        vibration.force = demodulate(vibration.force, force, phasor.real, phasor.imag, gain)
        vibration.drive = demodulate(vibration.drive, drive, phasor.real, phasor.imag, gain)
        state.force_square = track(state.force_square, force * force, gain)
        if parameters.kind == SIGN:
            state.sign_mean = track(state.sign_mean, sign_product(force, drive), gain)
    vibration.force_n, vibration.drive_m_s2 = size(vibration.force), size(vibration.drive)
    vibration.displacement_m = vibration.drive_m_s2 / (omega * omega)


@kernel
def force_rms(parameters: Record, state: Record) -> float:
    """Return the root mean square of the force without its mean, all harmonics together (N)."""
    if parameters.kind == ADAPTIVE:
        return root_mean_square(state.force_filter, parameters.harmonics)
    return math.sqrt(state.force_square)


@inner_kernel
def phase_error(
    parameters: Record, state: Record, vibration: Record, wanted_lag: float, lag_of_channels: float
) -> float:
    """Return wanted minus measured phase lag (rad), corrected for ``lag_of_channels``.

    ``lag_of_channels`` is the phase (rad) by which the force channel lags the acceleration channel: it is sampled later, or
    has a lower high-pass.
    """
    if parameters.kind == SIGN:
        return float(0.5 * math.pi * state.sign_mean - lag_of_channels)
    return wrap(wanted_lag - phase_lag(vibration.force, vibration.drive) - lag_of_channels)
