"""NetCDF files as groups and datasets with attributes, and Rattlesnake's recordings among them.

NetCDF 4 files are HDF5 files (`rig.exchange.foreign.hdf5`). Rattlesnake, Sandia's vibration controller, writes ``time_data``
[channel, sample] in engineering units, the attribute ``sample_rate``, and a table ``channels`` with unit, node number and node
direction (its ``components/streaming.py``).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rig.exchange.child_values import TooMuchData, most_bytes
from rig.exchange.file_data import ChannelFacts, Value

MAGIC = b"CDF"
"""First bytes of NetCDF up to version 3."""
_DATA, _TABLE = "time_data", "channels"


def read_classic(path: Path) -> dict[str, Value]:
    """Return variables and attributes (``name@attribute``) of a file of NetCDF 3; raise ValueError if it cannot be read."""
    from scipy.io import netcdf_file

    most = most_bytes(path)
    file: Any
    with netcdf_file(str(path), "r", mmap=False, maskandscale=False) as file:
        found: dict[str, Value] = dict(_attributes("", file._attributes))
        for name, variable in file.variables.items():
            values: NDArray[Any] = np.asarray(variable.data)
            most -= values.nbytes
            if most < 0:
                raise TooMuchData(most_bytes(path))
            native = values.astype(values.dtype.newbyteorder("="))
            found[name] = b"".join(native.ravel()).decode("utf-8", "replace") if native.dtype.kind == "S" else native
            found |= dict(_attributes(name, variable._attributes))
    return found


def _attributes(name: str, stored: dict[str, object]) -> Iterator[tuple[str, Value]]:
    for key, value in stored.items():
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        if isinstance(text, str | np.generic | np.ndarray | int | float):
            yield f"{name}@{key}", text


def of_rattlesnake(values: dict[str, Value]) -> tuple[dict[str, Value], dict[str, ChannelFacts], float | None]:
    """Return the values with one array for each channel, what the table says of each, and the sample rate.

    All is as it was, nothing and None for any other file.
    """
    data, table, rate = values.get(_DATA), values.get(_TABLE), values.get("@sample_rate")
    units = table.get("unit") if isinstance(table, dict) else None
    if not isinstance(data, np.ndarray) or data.ndim != 2 or not isinstance(units, list) or len(units) != len(data):
        return values, {}, None
    facts = {
        f"{_DATA}[{row}]": ChannelFacts(name=_name(cast("dict[str, Value]", table), row), unit=str(unit))
        for row, unit in enumerate(units)
    }
    number = float(rate) if isinstance(rate, np.generic | float | int) and float(rate) > 0.0 else None
    return {**values, _DATA: list(data)}, facts, number


def _name(table: dict[str, Value], row: int) -> str:
    """Return node and direction of a channel, such as ``12Z+``, and its type where the table has one."""
    parts = []
    for key in ("node_number", "node_direction"):
        column = table.get(key)
        parts.append(str(column[row]) if isinstance(column, list) and row < len(column) else "")
    return "".join(parts).strip()
