"""Records of the tick, and the bundle of arrays that its kernel takes.

One bundle holds the complete control state of a run; a copy of it is a checkpoint.
"""

from typing import NamedTuple

import numpy as np

from rig.daq import LOST
from vibrolock.arrays import record

LOOP = record(
    i8="sample delay_whole queue_whole force_channel drive_channel cycles held drive waveform play lost "
    "uncertain seen held_flag continued_flag played",
    f8="delay_fraction dt_s skew_samples force_high_pass_rad_s drive_high_pass_rad_s theta theta_in force drive_motion "
    "output_bit_v rounding_v",
)
"""State of the tick itself (one record): sample counter, delay from output to input, channels, oscillator phase at the
output and at the inputs, readings of the sample, source of the frequency. ``queue_whole``: whole samples from an output to
the converter. ``skew_samples``: delay of the force channel minus that of the drive channel; ``_high_pass_rad_s``: corners
of their high-passes. ``held``: the level is not being ramped. ``lost``: counts up with each lost sample and down with each
received one, never below 0. ``uncertain``: samples left in which the displacement is corrected after a loss. ``seen``:
number of samples received. ``held_flag``, ``continued_flag``: the device's flags of a held output and of one that it
continued; 0 if it has none. ``played``: 1 + the waveform that the last block has played; 0 for a tone. ``output_bit_v``: bit of
the output converter whose rounding is fed back, 0 for none; ``rounding_v``: the error that the last output was rounded by."""

HISTORY = record(f8="theta omega amplitude_v command_phase_rad output_v")
"""Outputs sent whose effect the inputs do not yet show; a ring."""

_COLUMNS = (
    ("output_v", "f4", "V", "voltage on the converter at this instant"),
    ("theta_rad", "f4", "rad", "oscillator phase on the converter at this instant, 0 to 2 pi"),
    ("frequency_hz", "f4", "Hz", "oscillator frequency at this instant"),
    ("command_v", "c8", "V", "complex amplitude U of the output, u = Re(U exp(i theta))"),
    (
        *("phase_error_rad", "f4", "rad"),
        "wanted minus measured phase lag, as the detector sees it; NaN while searching and in open loop",
    ),
    (
        *("flags", "u4", "1"),
        "bits: 1 output at its voltage limit, 2 frequency at its window, 4 sensor near its range, 8 level held; from 65536 "
        "(bit 16) on the device's own, named in its counters; bit 31 sample lost, inputs NaN",
    ),
    ("segment", "i2", "1", "number of the plan's segment; -1 while coming down"),
    ("lock", "u1", "1", "0 searching, 1 acquiring, 2 locked, 3 lost"),
    ("guard", "u1", "1", "0 disarmed, 1 armed, 2 ramping down, 3 off"),
)
"""Scalar columns of a telemetry row: name, type, unit, meaning."""

ROW = np.dtype([(name, kind) for name, kind, _, _ in _COLUMNS])
"""Scalar part of a telemetry row. Output, phase, frequency and command are those on the converter at that instant."""

ROW_COLUMNS: tuple[dict[str, str], ...] = (
    {"name": "inputs", "unit": "SI unit of each channel", "description": "inputs in SI units, one column a channel"},
    *({"name": name, "unit": unit, "description": meaning} for name, _, unit, meaning in _COLUMNS),
)
"""Unit and meaning of every recorded column, for the file."""

SATURATED = 1  # flag: the output stood at its limit
FREQUENCY_CLAMPED = 2  # flag: the frequency was at an end of its window
SENSOR_AT_RANGE = 4  # flag: an input was near its range
HELD = 8  # flag: a law held its level
DEVICE_SHIFT = 16  # bits by which the flags of the device are shifted
SAMPLE_LOST = LOST << DEVICE_SHIFT


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
