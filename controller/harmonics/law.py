"""The law of every sample: errors of the force's harmonics, the integral laws, and the harmonics of the output."""

import math

import numpy as np

from controller.adaptive_filter import adapt, turn_phasors
from controller.harmonics.records import CONTROLLING
from controller.primitives import size
from vibrolock.compiled import Record, inner_kernel, kernel

FULL = 1.0 - 1e-9  # of the largest voltage: above it harmonics are held back
LEFT_ALONE = 0.5  # of the smallest amplitude: an error below it moves nothing


@kernel
def want_harmonics(state: Record, wanted: np.ndarray) -> None:
    """Prescribe the channel's harmonics, as complex ratios to the fundamental: complex128[13], entry h is harmonic h."""
    state.prescribed = 0
    for order in range(2, wanted.size):
        state.wanted[order] = wanted[order]
        if wanted[order] != 0.0:
            state.prescribed = 1


@inner_kernel
def measure_harmonics(parameters: Record, state: Record, value: float, phasor: complex, omega: float) -> None:
    """Update the controlled channel's harmonics and their errors with one sample (N or m/s^2).

    ``value`` is as measured, with its mean: a filter that removes the mean would turn the harmonics against each other.
    ``phasor`` is ``exp(i theta)`` at the input, ``omega`` the oscillator's frequency (rad/s).
    """
    highest = parameters.highest
    gain = parameters.corner * omega * parameters.dt_s
    turn_phasors(state.phasors, highest, phasor.real, phasor.imag)
    adapt(state.filter, state.phasors, highest, value, gain)
    late = parameters.high_pass_rad_s / omega
    fundamental = state.filter[1] * complex(1.0, -late)
    amplitude = size(fundamental)
    turn = fundamental / amplitude if amplitude > 0.0 else complex(1.0, 0.0)
    turned = turn * amplitude
    for order in range(2, highest + 1):
        error = state.filter[order]
        if state.prescribed == 1:
            turned *= turn
            error = error * complex(1.0, -late / order) - state.wanted[order] * turned
        state.error[order] = error
        state.total[order] += error
    state.samples += 1


@inner_kernel
def drive_harmonics(
    parameters: Record, state: Record, amplitude_v: float, omega: float, running: bool, acts: bool
) -> None:
    """Evaluate the integral laws for one sample: update the harmonics of an output whose fundamental is ``amplitude_v``.

    Without ``acts`` they are kept. Once the run is not ``running`` any more, they come down with the fundamental. The whole
    output stays within the largest voltage: harmonics give way to the fundamental.
    """
    if running:
        state.amplitude_v = amplitude_v
        state.share = 1.0
    else:
        state.share = amplitude_v / state.amplitude_v if state.amplitude_v > 0.0 else 0.0
        return
    highest, total = parameters.highest, 0.0
    gain = parameters.integral * omega * parameters.dt_s
    most = parameters.largest * amplitude_v
    for order in range(2, highest + 1):
        aim, volts = state.aim[order], state.volts[order]
        if acts and state.off[order] == 0 and state.stage == CONTROLLING:
            error = state.error[order]
            if size(error) > LEFT_ALONE * parameters.smallest:
                step = -gain * error / state.plant[order]
                aim += step * min(1.0, parameters.step_v / max(size(step), parameters.step_v))
        aim *= most / max(size(aim), most) if most > 0.0 else 0.0
        way = aim - volts
        volts += way * min(1.0, parameters.step_v / max(size(way), parameters.step_v))
        volts *= most / max(size(volts), most) if most > 0.0 else 0.0
        state.aim[order], state.volts[order] = aim, volts
        total += size(volts)
    state.bounded = 1 if amplitude_v + total > FULL * parameters.largest_v else 0
    if amplitude_v + total > parameters.largest_v and total > 0.0:
        left = max(parameters.largest_v - amplitude_v, 0.0) / total
        for order in range(2, highest + 1):
            state.volts[order] *= left
            state.aim[order] = state.volts[order]


@inner_kernel
def harmonics_at(parameters: Record, state: Record, theta: float) -> float:
    """Return ``Re sum_h V_h exp(i h theta)`` (V), the harmonics of the output."""
    turn = complex(math.cos(theta), math.sin(theta))
    phasor, out = turn, 0.0
    for order in range(2, parameters.highest + 1):
        phasor *= turn
        volts = state.volts[order]
        out += volts.real * phasor.real - volts.imag * phasor.imag
    return float(state.share * out)
