"""Objects of MATLAB (timetables, tables, strings, times) in MAT files, by the package mat-io, as structures of arrays.

MATLAB stores them in a form that it does not document. A timetable becomes a structure of its variables and its row times, s, a
table one of its variables; their units are those of their properties. Without mat-io, a line says how to save them readably.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.exchange.file_data import ChannelFacts, Value

if TYPE_CHECKING:
    import pandas as pd

_NAMED = {
    "timetable": "s = table2struct(timetable2table({0}, 'ConvertRowTimes', false), 'ToScalar', true); "
    "s.Time = seconds({0}.Properties.RowTimes - {0}.Properties.RowTimes(1)); save('readable.mat', 's')",
    "table": "s = table2struct({0}, 'ToScalar', true); save('readable.mat', 's')",
    "timeseries": "s = struct('Time', {0}.Time, 'Data', {0}.Data); save('readable.mat', 's')",
    "string": "s = cellstr({0}); save('readable.mat', 's')",
    "categorical": "s = cellstr({0}); save('readable.mat', 's')",
    "duration": "s = seconds({0}); save('readable.mat', 's')",
    "datetime": "s = posixtime({0}); save('readable.mat', 's')",
}
_OTHER = "s = struct({0}); save('readable.mat', 's')"


def opaque_in(variables: Mapping[str, Value]) -> dict[str, str]:
    """Return the names of the objects that SciPy found, without reading them, and their classes; and where SciPy puts them."""
    from scipy.io.matlab import MatlabOpaque

    found: dict[str, str] = {}
    for key, value in variables.items():
        if isinstance(value, MatlabOpaque):
            name, kind = (np.ravel(value)[0][at].decode("latin-1") for at in ("s0", "s2"))
            found |= {key: "", "__function_workspace__": "", name: kind}
    return found


def read_objects(
    path: Path, kinds: Mapping[str, str], others: Mapping[str, Value]
) -> tuple[dict[str, Value], dict[str, ChannelFacts]]:
    """Return the variables that are objects, and what tables say of theirs.

    ``kinds`` are their classes by name, ``others`` the variables that are none. Objects that mat-io does not read are left out;
    what the file says of them is the MATLAB command that saves them readably. Raises ValueError with it without mat-io, and
    if nothing else is in the file.
    """
    try:
        from matio import load_from_mat
    except (ImportError, AttributeError, KeyError):  # the latter by a version of pandas that it does not know
        name, kind = next((name, kind) for name, kind in kinds.items() if kind)
        reason = "which needs the package mat-io (pip install 'vibrolock[formats]')"
        raise ValueError(f"'{name}' is a MATLAB {kind}, {reason}; or {advice(name, kind)}") from None
    found: dict[str, Any] = load_from_mat(str(path), add_table_attrs=True)
    values: dict[str, Value] = {}
    facts: dict[str, ChannelFacts] = {}
    for name, value in found.items():
        if name in others or name.startswith("__"):
            continue
        kind = kinds.get(name, "object")
        try:
            values[name] = plain(value, f"is a MATLAB {kind}, which is not read; {advice(name, kind)}")
            facts |= dict(_units(name, value))
        except ValueError as error:
            facts[name] = ChannelFacts(unread=str(error))
    first = next((name for name in facts if facts[name].unread), "")
    if first and not values and not others:
        raise ValueError(f"'{first}' {facts[first].unread}")
    return values, facts


def advice(name: str, kind: str) -> str:
    """Return the MATLAB command that saves an object readably."""
    return f"in MATLAB: {_NAMED.get(kind, _OTHER).format(name)}"


def plain(value: Any, otherwise: str) -> Value:
    """Return an object as numbers, texts, lists and structures; raise ValueError with ``otherwise`` for any other."""
    import pandas as pd

    if isinstance(value, pd.DataFrame):
        return _columns(value, otherwise)
    if not isinstance(value, np.ndarray):
        if isinstance(value, str | bool | int | float | np.number):
            return value
        raise ValueError(otherwise)
    if value.dtype.names:
        entries: list[Value] = [
            {name: plain(entry[name], otherwise) for name in value.dtype.names} for entry in value.reshape(-1)
        ]
        return entries[0] if len(entries) == 1 else entries
    if value.dtype.kind == "m":
        if np.datetime_data(value.dtype)[0] in "YM":
            raise ValueError(otherwise)  # calendar durations, which are no number of seconds
        return np.squeeze(value / np.timedelta64(1, "ns")) * 1e-9
    if value.dtype.kind == "M":
        return (
            np.squeeze((value - value.reshape(-1)[0]) / np.timedelta64(1, "ns")) * 1e-9 if value.size else np.zeros(0)
        )
    if value.dtype.kind in "OUT":
        items = [str(one) if isinstance(one, str) else plain(one, otherwise) for one in value.reshape(-1)]
        return items[0] if len(items) == 1 else items
    if value.dtype.kind in "biufc":
        return np.squeeze(value)
    raise ValueError(otherwise)


def _columns(table: "pd.DataFrame", otherwise: str) -> dict[str, Value]:
    import pandas as pd

    found: dict[str, Value] = {}
    if isinstance(table.index, pd.TimedeltaIndex | pd.DatetimeIndex):
        found[str(table.index.name or "Time")] = plain(table.index.to_numpy(), otherwise)
    for name in table.columns:
        column = table[name].to_numpy()
        if column.dtype.kind == "O" and all(isinstance(cell, np.ndarray) for cell in column):
            column = np.array([np.squeeze(cell) for cell in column])
        found[str(name)] = plain(column, otherwise)
    return found


def _units(name: str, table: Any) -> Iterable[tuple[str, ChannelFacts]]:
    """Yield the units of the variables of a table by their paths, and that of the row times."""
    import pandas as pd

    if not isinstance(table, pd.DataFrame):
        return
    if isinstance(table.index, pd.TimedeltaIndex | pd.DatetimeIndex):
        yield f"{name}.{table.index.name or 'Time'}", ChannelFacts(unit="s")
    units = np.ravel(np.asarray(table.attrs.get("varUnits", []), dtype=object))
    for column, unit in zip(table.columns, units, strict=False):
        text = str(np.ravel(unit)[0]) if np.size(unit) else ""
        if text:
            yield f"{name}.{column}", ChannelFacts(unit=text)
