"""One bin of the traces: what a stretch of rows has come down to. The same for a run under way and for a recording."""

import numpy as np


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
