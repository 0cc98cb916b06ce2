"""The loop that holds the response: it acts on the logarithm of the complex output, with a gain that follows the plant."""

import math
from typing import Literal

import numpy as np
from pydantic import Field

from controller.primitives import log_proportional_integral, log_ratio, size, wrap
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel
from vibrolock.errors import InputError

PLANT_VARIES = 3.0  # factor by which the plant's gain may be off and is still followed

RESPONSE_LOOP = record(i8="turns", f8="ki gain smallest_v largest_v dt_s", c16="kp plant_gain")
"""Parameters of the response loop (one record). ``turns``: whether the loop also holds the phase of the response, by turning
the phase of the output; ``gain``: step of the low-pass that the loop's error passes."""

RESPONSE_LOOP_STATE = record(f8="reference_turn", c16="log_integral error plant_ratio")
"""State of the response loop (one record). ``reference_turn``: angle at which the acceleration is held (rad);
``plant_ratio``: present gain of the plant, divided by the gain for which kp was designed."""


class ResponseSettings(Settings):
    """How a response is held."""

    response_loop: Literal["complex", "amplitude"] = "complex"
    """Whether the response's loop holds amplitude and phase (``complex``) or the amplitude alone."""
    response_integral_per_s: float = Field(0.0, ge=0, le=1e4)
    """K: integral gain of the response's loop, 1/s; above 0 where the loop holds a level."""
    plant_pole_rad_s: tuple[float, float] | None = None
    """p: real and imaginary part of the plant's pole (voltage to response) less i times the locked frequency, rad/s. It sets
    the proportional gain K/(-p), which cancels the pole; without it the loop has integral gain alone."""
    plant_gain_per_v: tuple[float, float] | None = None
    """Real and imaginary part of the drive point's acceleration over the output, m/s^2 per V, at the lock at which
    `plant_pole_rad_s` holds. With it the proportional gain follows the pole as this ratio changes with the level."""

    def build_response(self, smallest_v: float, largest_v: float, dt_s: float, gain: float) -> np.ndarray:
        """Return one record of `RESPONSE_LOOP` for an output from ``smallest_v`` to ``largest_v``.

        ``gain`` is the detector's low-pass step. Raises ValueError if the plant's pole is unstable.
        """
        out = np.zeros(1, RESPONSE_LOOP)
        out["kp"] = self._proportional()
        out["ki"] = self.response_integral_per_s
        out["plant_gain"] = 0.0 if self.plant_gain_per_v is None else complex(*self.plant_gain_per_v)
        out["turns"] = self.response_loop == "complex"
        out["gain"] = gain
        out["smallest_v"], out["largest_v"], out["dt_s"] = smallest_v, largest_v, dt_s
        return out

    def _proportional(self) -> complex:
        if self.plant_pole_rad_s is None:
            return 0.0
        pole = complex(*self.plant_pole_rad_s)
        if not pole.real < 0.0:
            raise InputError(field="plant_pole_rad_s", value=list(self.plant_pole_rad_s), allowed="a real part below 0")
        gain = self.response_integral_per_s / -pole
        return gain if self.response_loop == "complex" else gain.real


@kernel
def begin_response(parameters: Record, state: Record, vibration: Record, output: Record) -> None:
    """Start the loop from the present ``output``; the response will be held at its present phase."""
    amplitude = output.amplitude_v
    state.log_integral = complex(
        math.log(min(max(amplitude, parameters.smallest_v), parameters.largest_v)), output.command_phase_rad
    )
    state.reference_turn = math.atan2(vibration.drive.imag, vibration.drive.real)
    state.error = 0.0
    state.plant_ratio = 1.0


@kernel
def response_proportional(parameters: Record, state: Record, drive: complex, output: Record) -> complex:
    """Return the proportional gain adapted to the plant: ``kp (A/U)/G``, where G is the A/U for which kp was designed.

    A softening structure moves the plant's pole p. The shaker alone sets the residue R of ``A/U = R/(i W - p)``, so that -p
    is proportional to U/A. The ratio is limited to a factor of `PLANT_VARIES` either way. Without G the gain is constant.
    """
    if parameters.plant_gain == 0.0:
        return complex(parameters.kp)
    amplitude, phase_rad = output.amplitude_v, output.command_phase_rad
    if amplitude > 0.0:
        now = drive * complex(math.cos(phase_rad), -math.sin(phase_rad)) / amplitude / parameters.plant_gain
        state.plant_ratio += 0.25 * parameters.ki * parameters.dt_s * (now - state.plant_ratio)
    ratio = size(state.plant_ratio)
    bounded = min(max(ratio, 1.0 / PLANT_VARIES), PLANT_VARIES) / ratio if ratio > 0.0 else 0.0
    return complex(parameters.kp * state.plant_ratio * bounded)


@kernel
def hold_response(
    parameters: Record, state: Record, vibration: Record, output: Record, wanted_m: float
) -> tuple[float, float]:
    """Evaluate the loop for one sample: return amplitude (V) and angle (rad) of the output for the displacement ``wanted_m``.

    ``ln U = kp E + K int E``, ``E = ln(X_ref/X) + i (phi_0 - arg A_1)``; without ``turns`` E is its real part alone.
    """
    turned = 0.0
    if parameters.turns == 1:
        turned = wrap(state.reference_turn - math.atan2(vibration.drive.imag, vibration.drive.real))
    error = complex(log_ratio(wanted_m, vibration.displacement_m), turned)
    state.error += parameters.gain * (error - state.error)
    before = state.log_integral.imag
    demanded_v, angle, integral = log_proportional_integral(
        state.error,
        state.log_integral,
        response_proportional(parameters, state, vibration.drive, output),
        parameters.ki,
        parameters.dt_s,
        parameters.smallest_v,
        parameters.largest_v,
        output.saturation_sign,
    )
    if (integral.imag - before) * output.phase_saturation_sign > 0.0:  # the phase cannot change this way
        angle -= integral.imag - before
        integral = complex(integral.real, before)
    state.log_integral = integral
    return demanded_v, angle
