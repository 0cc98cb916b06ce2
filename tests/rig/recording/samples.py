"""Recordings with rows that anyone can work out again from their number."""

from pathlib import Path

import h5py
import numpy as np

from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter

ROW = np.dtype(
    [("sample", "<u4"), ("theta_rad", "<f4"), ("frequency_hz", "<f8"), ("locked", "?"), ("inputs", "<f4", (4,))]
)
COLUMNS = (
    Column("sample", "1", "number of the sample"),
    Column("theta_rad", "rad", "phase of the oscillator"),
    Column("frequency_hz", "Hz", "frequency of the oscillator"),
    Column("locked", "1", "lock state"),
    Column("inputs", "V", "inputs in the order of the channel table"),
)


def header(**changes):
    values = {
        "kind": "backbone",
        "configuration": {"bench": {"name": "magnet-beam", "µ": 0.25}, "plan": {"levels_n": [0.026, 0.56]}},
        "channels": [{"name": f"input {k}", "unit": "N" if k == 0 else "m/s²", "range_v": 10.0} for k in range(4)],
        "row_dtype": ROW,
        "columns": COLUMNS,
        "software_version": "0.1.0",
        "started": "2031-05-01T12:00:00Z",
        "seed": 7,
    }
    return Header(**(values | changes))


def rows(start, stop):
    """Rows ``start`` to ``stop``: noise drawn by the number of the sample, with every bit of the floats in use."""
    number = np.arange(start, stop, dtype=np.uint64)
    made = np.zeros(stop - start, ROW)
    made["sample"] = number
    made["theta_rad"] = np.sin(number.astype(np.float64))
    made["frequency_hz"] = 50.0 + np.cos(number.astype(np.float64) * 0.1)
    made["locked"] = number % 3 == 0
    for k in range(4):
        made["inputs"][:, k] = np.sin(number.astype(np.float64) * (k + 1.3))
    return made


def fill(writer: JournalWriter, first: int, n: int, *, block: int = 100, completed: bool | None = True) -> None:
    """One part of ``n`` rows with a point and an event; ``completed=None`` leaves it without an end."""
    writer.part({"first_sample": first})
    writer.event({"what": "armed", "sample": first})
    for start in range(first, first + n, block):
        writer.rows(rows(start, min(start + block, first + n)))
    writer.point(
        {"number": writer.n_points, "force_n": 0.1 * first, "settled": True, "periods": 20, "harmonics": [1.0, 0.5]}
    )
    if completed is not None:
        writer.end({"completed": completed, "overruns": 0})


def journal(path: Path, n: int = 1000, **changes) -> Path:
    """A journal at ``path`` with one ended part of ``n`` rows."""
    with JournalWriter.create(path, header(**changes)) as writer:
        fill(writer, 0, n)
    return path


def without_digest(path: Path) -> Path:
    """The HDF5 file at ``path`` as a program leaves it that has opened it for writing and changed nothing."""
    h5py.File(path, "r+").close()
    return path


def all_rows(part):
    """The rows of a part put together again from their fields."""
    made = np.zeros(part.n_rows, ROW)
    for name in ROW.names:
        made[name] = part.rows(name)
    return made
