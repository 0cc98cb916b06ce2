"""The amplitude law: selects the loop that sets the output's amplitude, and switches between loops without a bump."""

import math
from enum import IntEnum

import numpy as np

from controller.force import FORCE_LOOP, FORCE_LOOP_STATE, THROUGH_RESPONSE, ForceSettings, begin_force, hold_force
from controller.primitives import wrap
from controller.response import RESPONSE_LOOP, RESPONSE_LOOP_STATE, ResponseSettings, begin_response, hold_response
from controller.through_response import (
    REFERENCE,
    REFERENCE_STATE,
    ThroughResponseSettings,
    begin_reference,
    force_at_lag,
    force_slope,
    wanted_displacement,
)
from vibrolock.arrays import record
from vibrolock.compiled import Record, inner_kernel, kernel
from vibrolock.errors import InputError

SMALLEST_PART = 1e-5  # of the largest voltage: where a logarithmic law begins from rest
HELD_BACK = 1e-3  # an output further than this part from what the law demands is not at its level


class AmplitudeLaw(IntEnum):
    """Quantity that a level prescribes; it decides which loop sets the output's amplitude."""

    VOLTAGE = 0
    """Amplitude of the output voltage (V, peak): no loop."""
    FORCE = 1
    """Amplitude of the fundamental force (N, peak)."""
    FORCE_RMS = 2
    """Root mean square of the force without its mean, all harmonics together (N)."""
    RESPONSE = 3
    """Amplitude of the drive point's fundamental displacement (m, peak)."""


VOLTAGE, FORCE, FORCE_RMS, RESPONSE = (int(law) for law in AmplitudeLaw)

AMPLITUDE = record(("force", FORCE_LOOP), ("response", RESPONSE_LOOP), ("reference", REFERENCE), f8="largest_v")
"""Parameters of the amplitude law (one record), with one record for each of its loops."""

OUTPUT = record(i8="saturation_sign phase_saturation_sign", f8="amplitude_v command_phase_rad")
"""The last output (one record): amplitude and angle of ``u = Re(U exp(i theta))``.

``saturation_sign``, ``phase_saturation_sign``: 1 while a limit keeps amplitude or angle from rising as fast as demanded, -1
while it keeps them from falling as fast, else 0."""

AMPLITUDE_STATE = record(
    ("output", OUTPUT),
    ("force", FORCE_LOOP_STATE),
    ("response", RESPONSE_LOOP_STATE),
    ("reference", REFERENCE_STATE),
    i8="law saturated",
    f8="demanded_v demanded_phase_rad",
)
"""State of the amplitude law (one record): the present `AmplitudeLaw`, the demanded amplitude and angle, whether the demanded
amplitude is at the largest voltage, the last output, and one record for each loop."""


class AmplitudeSettings(ThroughResponseSettings, ResponseSettings, ForceSettings):
    """Settings of the loops that hold levels in newtons and metres."""

    def build_amplitude(
        self, amplitude_law: AmplitudeLaw, largest_v: float, dt_s: float, gain: float, sees_rest: bool
    ) -> np.ndarray:
        """Return one record of `AMPLITUDE`.

        ``gain`` is the detector's low-pass step; ``sees_rest`` says whether the steady force is estimated. Raises ValueError
        if the loop that should hold the levels has no integral gain.
        """
        through = self.force_loop == "through-response"
        if amplitude_law in (AmplitudeLaw.FORCE, AmplitudeLaw.FORCE_RMS):
            if self.force_loop == "linear" and self.k4 == 0.0:
                reason = "levels in newtons need the force loop's integral gain"
                raise InputError(reason, field="k4", value=0, allowed="above 0")
            if through and self.reference_integral_per_s == 0.0:
                reason = "a force held through the response needs it above 0"
                raise InputError(reason, field="reference_integral_per_s", value=0)
        held = amplitude_law is AmplitudeLaw.RESPONSE or (through and amplitude_law is not AmplitudeLaw.VOLTAGE)
        if held and self.response_integral_per_s == 0.0:
            raise InputError("a response is held with a gain above 0", field="response_integral_per_s", value=0)
        smallest_v = SMALLEST_PART * largest_v
        out = np.zeros(1, AMPLITUDE)
        out["largest_v"] = largest_v
        out["force"] = self.build_force(smallest_v, largest_v, dt_s)
        out["response"] = self.build_response(smallest_v, largest_v, dt_s, gain)
        out["reference"] = self.build_reference(dt_s, sees_rest)
        return out


@inner_kernel
def held_amplitude(state: Record, vibration: Record) -> float:
    """Return the measured value of the held quantity: force (N), its RMS (N) or displacement (m); 0 without a loop."""
    if state.law == FORCE:
        return float(vibration.force_n)
    if state.law == FORCE_RMS:
        return float(vibration.force_rms_n)
    return float(vibration.displacement_m) if state.law == RESPONSE else 0.0


@kernel
def take_over(parameters: Record, state: Record, vibration: Record, law: int) -> float:
    """Switch to another `AmplitudeLaw` and return the present level (V, N or m), at which the new law starts.

    All integrals start from the present output, so that the output does not jump.
    """
    state.law = law
    state.demanded_phase_rad = state.output.command_phase_rad
    state.output.phase_saturation_sign = 0
    begin_force(parameters.force, state.force, state.output.amplitude_v)
    begin_response(parameters.response, state.response, vibration, state.output)
    begin_reference(state.reference, vibration.displacement_m)
    return float(state.output.amplitude_v if law == VOLTAGE else held_amplitude(state, vibration))


@inner_kernel
def demand(
    parameters: Record, state: Record, vibration: Record, level: float, wanted_lag: float, omega: float, by_loop: bool
) -> float:
    """Evaluate the amplitude law for one sample: return the output amplitude (V) for ``level`` (V, N or m).

    The output's angle is written to ``state.demanded_phase_rad``. Loops that control the response keep their last demand while
    force and motion are not ``present``. ``by_loop``: the frequency law sets the frequency ``omega`` (rad/s) so as to reach
    ``wanted_lag`` (rad). If the plan gives the frequency there is no wanted lag.
    """
    output, saturation_sign = state.output, state.output.saturation_sign
    held = held_amplitude(state, vibration)
    if state.law == VOLTAGE:
        state.demanded_v = level
    elif state.law != RESPONSE and parameters.force.loop != THROUGH_RESPONSE:
        state.demanded_v = hold_force(parameters.force, state.force, level, held, saturation_sign)
    elif vibration.present == 1:
        wanted_m = level
        if state.law != RESPONSE:
            active, slope = held, 1.0
            if by_loop:
                active = force_at_lag(vibration, held, wanted_lag, state.law == FORCE_RMS)
                slope = force_slope(parameters.reference, state.reference, vibration, wanted_lag, omega)
            wanted_m = wanted_displacement(
                parameters.reference, state.reference, level, active, slope, state.saturated == 1, saturation_sign
            )
        state.demanded_v, phase_rad = hold_response(parameters.response, state.response, vibration, output, wanted_m)
        if parameters.response.turns == 1:
            state.demanded_phase_rad = phase_rad
    state.saturated = 1 if state.demanded_v >= parameters.largest_v else 0
    return float(state.demanded_v)


@inner_kernel
def track_saturation(state: Record, demanded_v: float, amplitude_v: float, phase_rad: float) -> None:
    """Store the actual output after all limits (V, rad), and which way it is held back from the demanded output."""
    output = state.output
    output.amplitude_v, output.command_phase_rad = amplitude_v, phase_rad
    output.saturation_sign = output.phase_saturation_sign = 0
    if abs(amplitude_v - demanded_v) > HELD_BACK * abs(demanded_v):
        output.saturation_sign = 1 if demanded_v > amplitude_v else -1
    if phase_rad != state.demanded_phase_rad:
        output.phase_saturation_sign = 1 if wrap(state.demanded_phase_rad - phase_rad) > 0.0 else -1


def amplitude_state(parameters: np.ndarray) -> np.ndarray:
    """Return the state of an amplitude law that starts at rest."""
    out = np.zeros(1, AMPLITUDE_STATE)
    log_smallest_v = math.log(float(parameters["force"]["smallest_v"][0]))
    out["force"]["log_integral"] = out["response"]["log_integral"] = log_smallest_v
    return out
