"""Records of the tick, and the bundle of arrays that its kernel takes.

One bundle holds the complete control state of a run; a copy of it is a checkpoint.
"""

from typing import NamedTuple

import numpy as np

from rig.daq import LOST

LOOP = np.dtype(
    [
        ("sample", "i8"),
        ("delay_whole", "i8"),
        ("delay_fraction", "f8"),
        ("queue_whole", "i8"),
        ("dt_s", "f8"),
        ("force_channel", "i8"),
        ("drive_channel", "i8"),
        ("skew_samples", "f8"),
        ("theta", "f8"),
        ("theta_in", "f8"),
        ("cycles", "i8"),
        ("held", "i8"),
        ("force", "f8"),
        ("drive_motion", "f8"),
        ("drive", "i8"),
        ("waveform", "i8"),
        ("play", "i8"),
        ("lost", "i8"),
        ("seen", "i8"),
        ("held_flag", "i8"),
        ("continued_flag", "i8"),
        ("played", "i8"),
    ]
)
"""State of the tick itself (one record): sample counter, delay from output to input, channels, oscillator phase at the output
and at the inputs, readings of the sample, source of the frequency. ``queue_whole``: whole samples from an output to the
converter. ``skew_samples``: delay of the force channel minus that of
the drive channel. ``held``: the level is not being ramped. ``lost``: counts up with each lost sample and down with each
received one, never below 0. ``seen``: number of samples received. ``held_flag``, ``continued_flag``: the device's flags
of a held output and of one that it continued; 0 if it has none. ``played``: 1 + the waveform that the last block has played;
0 for a tone."""

HISTORY = np.dtype([("theta", "f8"), ("omega", "f8"), ("amplitude_v", "f8"), ("turn", "f8"), ("output_v", "f8")])
"""Outputs sent whose effect the inputs do not yet show; a ring."""

ROW = np.dtype(
    [
        ("output_v", "f4"),
        ("theta_rad", "f4"),
        ("frequency_hz", "f4"),
        ("command_v", "c8"),
        ("phase_error_rad", "f4"),
        ("flags", "u4"),
        ("segment", "i2"),
        ("lock", "u1"),
        ("guard", "u1"),
    ]
)
"""Scalar part of a telemetry row. Output, phase, frequency and command are those on the converter at that instant."""

SATURATED = 1  # flag: the output stood at its limit
FREQUENCY_CLAMPED = 2  # flag: the frequency stood at an end of its window
SENSOR_AT_RANGE = 4  # flag: an input was near its range
HELD = 8  # flag: a law held its level
DEVICE_SHIFT = 16  # bits by which the flags of the device are shifted
SAMPLE_LOST = LOST << DEVICE_SHIFT

ROW_COLUMNS: tuple[dict[str, str], ...] = (
    {"name": "inputs", "unit": "SI unit of each channel", "description": "inputs in SI units, one column a channel"},
    {"name": "output_v", "unit": "V", "description": "voltage on the converter at this instant"},
    {"name": "theta_rad", "unit": "rad", "description": "oscillator phase on the converter at this instant, 0 to 2 pi"},
    {"name": "frequency_hz", "unit": "Hz", "description": "oscillator frequency at this instant"},
    {"name": "command_v", "unit": "V", "description": "complex amplitude U of the output, u = Re(U exp(i theta))"},
    {
        "name": "phase_error_rad",
        "unit": "rad",
        "description": "wanted minus measured phase lag, as the detector sees it; NaN while searching and in open loop",
    },
    {
        "name": "flags",
        "unit": "1",
        "description": "bits: 1 output at its voltage limit, 2 frequency at its window, 4 sensor near its range, "
        "8 level held; from 65536 (bit 16) on the device's own, named in its counters; bit 31 sample lost, inputs NaN",
    },
    {"name": "segment", "unit": "1", "description": "number of the plan's segment; -1 while coming down"},
    {"name": "lock", "unit": "1", "description": "0 searching, 1 acquiring, 2 locked, 3 lost"},
    {"name": "guard", "unit": "1", "description": "0 disarmed, 1 armed, 2 ramping down, 3 off"},
)
"""Unit and meaning of every recorded column, for the file."""


def recorded_row(n_channels: int) -> np.dtype:
    """Dtype of a recorded row: the inputs (float32, SI units), then the scalars of `ROW`."""
    return np.dtype([("inputs", "f4", (n_channels,)), *((name, ROW[name]) for name in ROW.names or ())])


class TickArrays(NamedTuple):
    """All arrays that the tick reads and writes. The first seven are constants of the run, the others are its state.

    ``law`` has the dtype `controller.law.LAW`; its state ``control`` has the dtype `controller.law.CONTROL`. ``waveforms``
    [n, period] are periodic waveforms of unit peak that segments may play; [1, 1] if there are none.
    """

    law: np.ndarray
    rule: np.ndarray
    limits: np.ndarray
    inputs: np.ndarray
    expected: np.ndarray
    segments: np.ndarray
    waveforms: np.ndarray
    loop: np.ndarray
    control: np.ndarray
    guard: np.ndarray
    watches: np.ndarray
    plausibility: np.ndarray
    settling: np.ndarray
    progress: np.ndarray
    outcomes: np.ndarray
    history: np.ndarray
