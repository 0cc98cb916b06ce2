"""What a run publishes, as records: the frame with the present state, and the bins of the traces."""

import numpy as np

FRAME = np.dtype(
    [
        ("written_ns", "i8"),
        ("sample", "i8"),
        ("part", "i8"),
        ("lock", "i8"),
        ("guard", "i8"),
        ("reason", "i8"),
        ("channel", "i8"),
        ("value", "f8"),
        ("segment", "i8"),
        ("kind", "i8"),
        ("drive", "i8"),
        ("point", "i8"),
        ("finished", "i8"),
        ("total", "i8"),
        ("level", "f8"),
        ("target", "f8"),
        ("frequency_hz", "f8"),
        ("phase_error_rad", "f8"),
        ("voltage_v", "f8"),
        ("force_n", "f8"),
        ("drive_m_s2", "f8"),
        ("displacement_m", "f8"),
        ("good_periods", "i8"),
        ("settled_periods", "i8"),
        ("left_s", "f8"),
        ("lost", "i8"),
        ("overruns", "i8"),
        ("late_us", "f8", (4,)),
        ("window", "i8"),
    ]
)
"""State of a run at its last row (one record).

``written_ns``: the system's monotonic clock, ns. ``part`` counts the parts from 1. ``lock``, ``guard``, ``reason``:
`controller.LockState`, `rig.tick.safety.layout.GuardMode` and ``EndReason``, the last with its ``channel`` (-1 if none) and
``value``. ``segment``, ``kind``, ``drive``, ``point``: place in the plan, -1 if none. ``finished`` of ``total`` points are
over. ``level``, ``target``: present and final level of the segment, in the plan's unit. ``phase_error_rad``: mean over the
last rows; NaN while there is none. ``voltage_v``, ``force_n``, ``drive_m_s2``, ``displacement_m``: amplitudes of the
fundamentals, the last two at the drive point. ``good_periods`` of ``settled_periods`` are reached while settling.
``left_s``: estimate of the time left. ``lost``: samples lost in a row; ``overruns``: blocks that came too late;
``late_us``: p50, p99, p99.9 and largest response time of the loop, NaN without a clock. ``window``: number of rows that
follow the record."""

HEAD = 8
"""Bytes before a frame (its checksum; 0: there is no frame) and before the bins (their number)."""
WINDOW_BYTES = 1 << 18  # bytes of the last rows in a frame, at most; chosen
MOST_ROWS = 4096  # rows in a frame, at most; chosen
BINS = 3000  # bins that are kept; chosen: five minutes
BIN_S = 0.1
"""Least duration of a bin of the traces, s of the test: five minutes are kept of a test by the clock."""


def window_rows(row_dtype: np.dtype) -> int:
    """Return how many of the last rows a frame holds at most."""
    return min(MOST_ROWS, WINDOW_BYTES // row_dtype.itemsize)


def bin_dtype(n_channels: int) -> np.dtype:
    """Return the record of a bin: its end in s of the part, lock and guard, and least and greatest values within it."""
    pair = ("f4", (2,))
    return np.dtype(
        [
            ("end_s", "f8"),
            ("part", "i4"),
            ("lock", "u1"),
            ("guard", "u1"),
            ("frequency_hz", *pair),
            ("phase_error_rad", *pair),
            ("voltage_v", *pair),
            ("level", *pair),
            ("inputs", "f4", (n_channels, 2)),
        ]
    )


def put_bin(one: np.void, rows: np.ndarray, *, end_s: float, part: int, level: float) -> None:
    """Fill a record of `rig.live.layout.bin_dtype` from the rows within it: least and greatest values, NaN where none is known.

    ``end_s``: time of the part at its end, s. ``level`` is the one at the end, in the plan's unit.
    """
    one["end_s"], one["part"], one["level"] = end_s, part, level
    one["lock"], one["guard"] = rows["lock"][-1], rows["guard"][-1]
    for name, values in (
        ("frequency_hz", rows["frequency_hz"]),
        ("phase_error_rad", rows["phase_error_rad"]),
        ("voltage_v", np.abs(rows["command_v"])),
    ):
        one[name] = np.fmin.reduce(values), np.fmax.reduce(values)
    inputs = np.ascontiguousarray(rows["inputs"].T)  # each channel in one piece: five times as quick
    one["inputs"][:, 0], one["inputs"][:, 1] = np.fmin.reduce(inputs, axis=1), np.fmax.reduce(inputs, axis=1)
