"""Content of an export, in one form for all formats: named arrays with units, and attributes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibrolock.units import unit_of

Array = NDArray[Any]
Labels = tuple[tuple[str, ...], ...]

_NORMALISED = {"modal_amplitude": "kg^0.5 m", "force_harmonics": "N", "shapes": "kg^-0.5"}
"""Units of arrays whose names do not end in theirs, by the end of the name."""


def array_unit(name: str) -> str:
    """Return an array's SI unit by the end of its name; 1 without one. ``x_std`` has the unit of ``x``."""
    for end in ("_std", "_low", "_high", "_total_power", "_uncorrected"):
        name = name.removesuffix(end)
    return next((unit for end, unit in _NORMALISED.items() if name.endswith(end)), unit_of(name)) or "1"


@dataclass(frozen=True, eq=False)
class Contents:
    """The content of one exported object."""

    kind: str
    """Kind of the object, for example ``nonlinear-mode``."""
    title: str
    """Description for a person: specimen, point or level."""
    arrays: Mapping[str, Array]
    """Arrays of the object, by name."""
    attributes: Mapping[str, Any]
    """Everything else, ready for JSON."""
    rows: Mapping[str, int]
    """For every array that belongs in a table: the array's axis along the table's rows."""
    units: Mapping[str, str | Array] = field(default_factory=dict)
    """Units of arrays: one, or several that broadcast to the axes other than the rows. By default `array_unit`."""
    labels: Mapping[str, Labels] = field(default_factory=dict)
    """Names along the axes other than the rows."""

    def unit(self, name: str) -> str | Array:
        """Return the unit of an array, or the units of its columns."""
        return self.units.get(name, array_unit(name))

    def summary(self) -> dict[str, Any]:
        """Return kind, title, number of rows and names of the arrays."""
        rows = next((np.shape(self.arrays[name])[axis] for name, axis in self.rows.items()), 0)
        return {"kind": self.kind, "title": self.title, "rows": int(rows), "arrays": list(self.arrays)}

    def columns(self, name: str) -> list[tuple[str, str, Array]]:
        """Return name, unit and values of every column of an array; real and imaginary part are separate columns."""
        table = np.moveaxis(np.asarray(self.arrays[name]), self.rows[name], 0)
        units = np.broadcast_to(np.asarray(self.unit(name)), table.shape[1:])
        labels = self.labels.get(name) or tuple(tuple(map(str, range(size))) for size in table.shape[1:])
        out = []
        for index in np.ndindex(table.shape[1:]):
            marks = ":".join(axis[i] for axis, i in zip(labels, index, strict=True))
            title, unit, values = f"{name}[{marks}]" if marks else name, str(units[index]), table[(slice(None), *index)]
            if np.iscomplexobj(table):
                out += [(f"{title}.re", unit, values.real), (f"{title}.im", unit, values.imag)]
            else:
                out.append((title, unit, values))
        return out
