"""MAT files of version 5, which MATLAB, Octave and SciPy read: one structure, or an array of structures.

A structure contains the arrays by name, ``units`` with the same names, ``channels`` if there are any, and two texts:
``vibrolock_kind``, and ``attributes_json`` with everything else that is needed to read the file back unchanged.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.text.contents import Contents

_KIND, _ATTRIBUTES = "vibrolock_kind", "attributes_json"
_LONGEST = 31  # largest number of characters of a field name that every reader of version 5 accepts


def write_mat(items: Sequence[Contents], path: Path) -> None:
    """Write one structure, or a 1 x n array of them, under the name of each kind; may raise any error of SciPy."""
    from scipy.io import savemat

    kinds = dict.fromkeys(item.kind for item in items)
    variables = {
        kind.replace("-", "_"): _variable([_structure(item) for item in items if item.kind == kind]) for kind in kinds
    }
    savemat(str(path), variables, appendmat=False, oned_as="column", long_field_names=False)


def _variable(structures: Sequence[Mapping[str, Any]]) -> Any:
    """Return a single structure unchanged, several as an array."""
    if len(structures) == 1:
        return structures[0]
    names = _names(structures)
    value = np.empty((1, len(structures)), dtype=[(name, object) for name in names])
    for column, structure in enumerate(structures):
        value[0, column] = tuple(structure.get(name, np.zeros((0, 0))) for name in names)
    return value


def _names(structures: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(key for structure in structures for key in structure))


def _structure(item: Contents) -> dict[str, Any]:
    shapes = {name: list(np.shape(array)) for name, array in item.arrays.items()}
    out: dict[str, Any] = {"title": item.title}
    out |= {name[:_LONGEST]: np.asarray(array) for name, array in item.arrays.items()}
    out["units"] = {name[:_LONGEST]: _text(item.unit(name)) for name in item.arrays}
    for name in ("channels", "outputs", "inputs"):
        if name in item.attributes:
            out[name] = _table(item.attributes[name])
    out[_KIND] = item.kind
    out[_ATTRIBUTES] = json.dumps({"shapes": shapes, "attributes": item.attributes})
    return out


def _text(unit: Any) -> Any:
    """Return a unit as text, and several units as a cell array with the shape of their array."""
    return unit if isinstance(unit, str) else np.asarray(unit).astype(object)


def _table(channels: Sequence[Mapping[str, str]]) -> Any:
    """Return channels as a structure array."""
    table = np.empty(len(channels), dtype=[(key, object) for key in ("name", "role", "unit")])
    for row, channel in enumerate(channels):
        table[row] = (channel["name"], channel["role"], channel["unit"])
    return table


def read_mat(path: Path) -> dict[str, Any]:
    """Read a MAT file (version 4 to 7.3) as nested dictionaries, lists and arrays; raise `ImportFailed` if this fails."""
    found: dict[str, Any] = read_in_child("mat", path, NAMES["mat"])
    return found


def parsed_mat(path: Path) -> dict[str, Any]:
    """Read a MAT file in this process, which may crash; the child process does. May raise any error."""
    from scipy.io import loadmat

    from rig.exchange.foreign.matlab_hdf5 import read_matlab_hdf5

    try:
        found: dict[str, Any] = loadmat(str(path), simplify_cells=True, appendmat=False)
    except NotImplementedError:  # version 7.3
        return read_matlab_hdf5(path)
    return found


def structures_of_ours(data: Mapping[str, Any]) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Return kind, arrays and attributes of every structure that `write_mat` wrote; raise `ImportFailed` for damaged ones."""
    found = []
    for value in data.values():
        for entry in value if isinstance(value, list | np.ndarray) else [value]:
            if isinstance(entry, Mapping) and _KIND in entry:
                found.append(_restored(entry))
    return found


def _restored(entry: Mapping[str, Any]) -> tuple[str, dict[str, Any], dict[str, Any]]:
    try:
        told = json.loads(str(entry[_ATTRIBUTES]))
        arrays = {name: np.asarray(entry[name[:_LONGEST]]).reshape(shape) for name, shape in told["shapes"].items()}
        return str(entry[_KIND]), arrays, told["attributes"]
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise ImportFailed(
            f"the structure of kind {entry[_KIND]} was changed: {error}; its arrays must keep their names and sizes, "
            "or give a mapping"
        ) from None
