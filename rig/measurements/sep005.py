"""Recorded signals as time series of SEP005, the proposal of SDyPy for data that its packages pass on to each other.

A time series is a dictionary: ``data`` (float64[n]), ``name``, ``unit_str``, and ``fs`` (Hz) or ``time`` (list, s); here also
``quantity`` (f, a, v, d), ``group`` and ``start_timestamp``. The proposal is in https://github.com/sdypy;
the package ``sdypy-sep005`` checks whether a list of dictionaries follows it.
"""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from rig.measurements.tables import selected_rows
from rig.recording.reader import Recording

QUANTITIES = {"N": "f", "m/s^2": "a", "m/s2": "a", "m/s": "v", "m": "d"}
"""Letter of a quantity by its unit; others have none."""
VOLTAGE = "output_v"


def time_series(
    recording: Recording,
    *,
    columns: Sequence[str] | None = None,
    part: int | None = None,
    point: int | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
) -> list[dict[str, Any]]:
    """Return recorded signals as time series of SEP005, one dictionary a signal, in the units of the channels.

    ``columns`` are names of channels and of other columns; by default all channels and the output voltage. Rows are selected as
    in `rig.measurements.tables.telemetry`. Evenly spaced rows have ``fs``, others ``time`` from the beginning of the part.
    ``start_timestamp`` is that of the first row, by the clock of the recording's start; only the first part has it. Lost
    samples are NaN. Raises `RecordingError` for a column, part or point that there is not.
    """
    wanted = [*(str(channel["name"]) for channel in recording.channels), VOLTAGE] if columns is None else columns
    number, samples, found = selected_rows(recording, wanted, part, point, from_s, to_s)
    rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    of_a_point = "" if point is None else f", point {point}"
    facts: dict[str, Any] = {"group": f"{recording.kind}, part {number}{of_a_point}"}
    steps = np.unique(np.diff(samples))
    facts |= {"fs": rate_hz / float(steps[0])} if steps.size == 1 else {"time": (samples / rate_hz).tolist()}
    if number == 1 and samples.size:
        begin = datetime.fromisoformat(recording.started) + timedelta(seconds=float(samples[0]) / rate_hz)
        facts["start_timestamp"] = begin.isoformat()
    out = []
    for name, values, attributes in found:
        unit = attributes["units"]
        letter = {"quantity": QUANTITIES[unit]} if unit in QUANTITIES else {}
        out.append({"data": np.asarray(values, np.float64), "name": name, "unit_str": unit, **letter, **facts})
    return out
