"""Kernels between a loop and a device at N times its rate: outputs on straight lines, inputs filtered and decimated."""

import numpy as np

from rig.daq import LOST
from vibrolock.compiled import kernel


@kernel
def draw_lines(from_v: float, voltages: np.ndarray, drawn: np.ndarray) -> None:
    """Fill the outputs of the device, float[n N], V: straight lines from ``from_v``, each of which ends at one of float[n]."""
    times = drawn.size // voltages.size
    for index in range(voltages.size):
        to_v = voltages[index]
        for part in range(times - 1):
            drawn[index * times + part] = from_v + (to_v - from_v) * (part + 1) / times
        drawn[index * times + times - 1] = to_v
        from_v = to_v


@kernel
def decimate(past: np.ndarray, read: np.ndarray, taps: np.ndarray, inputs: np.ndarray) -> None:
    """Fill the inputs of the loop, float[n, n_channels], with those of the device, float[n N, n_channels], behind a low-pass.

    ``past`` (float[n_taps - 1, n_channels]) has the last readings before these, and afterwards up to these.
    """
    times, before = read.shape[0] // inputs.shape[0], past.shape[0]
    for index in range(inputs.shape[0]):
        first = (index + 1) * times - taps.size
        for channel in range(inputs.shape[1]):
            total = 0.0
            for tap in range(taps.size):
                row = first + tap
                total += taps[tap] * (read[row, channel] if row >= 0 else past[before + row, channel])
            inputs[index, channel] = total
    for row in range(before):
        later = row + read.shape[0] - before
        for channel in range(inputs.shape[1]):
            past[row, channel] = read[later, channel] if later >= 0 else past[row + read.shape[0], channel]


@kernel
def reduce_events(
    device_flags: np.ndarray, device_put_out: np.ndarray, inputs: np.ndarray, flags: np.ndarray, put_out: np.ndarray
) -> None:
    """Fill flags and outputs of the loop's samples, [n], from those of the device, [n N].

    A sample has the flags of all of its device samples, the output at its end, and `LOST` where an input is not a number.
    """
    times = device_flags.size // flags.size
    for index in range(flags.size):
        end = (index + 1) * times
        raised = device_flags[index * times]
        for row in range(index * times + 1, end):
            raised |= device_flags[row]
        for channel in range(inputs.shape[1]):
            if np.isnan(inputs[index, channel]):
                raised |= np.uint16(LOST)
        flags[index] = raised
        put_out[index] = device_put_out[end - 1]
