"""MAT files of version 5, which MATLAB, Octave and SciPy read: one structure, or an array of structures.

A structure contains the arrays by name, ``units`` with the same names, ``channels`` if there are any, and two texts:
``vibrolock_kind``, and ``attributes_json`` with everything else that is needed to read the file back unchanged.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.file_data import FileData, StoredObject, Value, from_variables
from rig.text.contents import Contents

_KIND, _ATTRIBUTES = "vibrolock_kind", "attributes_json"
_MAX_NAME = 31  # most characters of a field name that every reader of version 5 accepts


def write_mat(items: Sequence[Contents], path: Path) -> None:
    """Write one structure, or a 1 x n array of them, under the name of each kind; may raise any error of SciPy."""
    from scipy.io import savemat

    kinds = dict.fromkeys(item.kind for item in items)
    variables = {
        kind.replace("-", "_"): _variable([_structure(item) for item in items if item.kind == kind]) for kind in kinds
    }
    savemat(str(path), variables, appendmat=False, oned_as="column", long_field_names=False)


def _variable(structures: Sequence[Mapping[str, object]]) -> object:
    if len(structures) == 1:
        return structures[0]
    names = list(dict.fromkeys(key for structure in structures for key in structure))
    value = np.empty((1, len(structures)), dtype=[(name, object) for name in names])
    for column, structure in enumerate(structures):
        value[0, column] = tuple(structure.get(name, np.zeros((0, 0))) for name in names)
    return value


def _structure(item: Contents) -> dict[str, object]:
    shapes = {name: list(np.shape(array)) for name, array in item.arrays.items()}
    out: dict[str, object] = {"title": item.title}
    out |= {name[:_MAX_NAME]: np.asarray(array) for name, array in item.arrays.items()}
    units = {name: item.unit(name) for name in item.arrays}  # several units become a cell array
    out["units"] = {
        name[:_MAX_NAME]: unit if isinstance(unit, str) else np.asarray(unit).astype(object)
        for name, unit in units.items()
    }
    for name in ("channels", "outputs", "inputs"):
        if name in item.attributes:
            texts = [(channel["name"], channel["role"], channel["unit"]) for channel in item.attributes[name]]
            out[name] = np.array(texts, dtype=[(key, object) for key in ("name", "role", "unit")])
    out[_KIND] = item.kind
    out[_ATTRIBUTES] = json.dumps({"shapes": shapes, "attributes": item.attributes})
    return out


def read_mat(path: Path) -> FileData:
    """Read a MAT file (version 4 to 7.3); raise `ImportFailed` if this fails."""
    return read_in_child("mat", path, NAMES["mat"], FileData)


def parsed_mat(path: Path) -> FileData:
    """Read a MAT file in this process, which may crash; the child process does. May raise any error."""
    from scipy.io import loadmat

    from rig.exchange.foreign.matlab_hdf5 import read_matlab_hdf5

    try:
        variables: dict[str, Value] = loadmat(str(path), simplify_cells=True, appendmat=False)
    except NotImplementedError:  # version 7.3
        variables = read_matlab_hdf5(path)
    return from_variables(variables)


def stored_objects(data: FileData) -> list[StoredObject]:
    """Return every structure that `write_mat` wrote; raise `ImportFailed` for damaged ones."""
    return [
        _restored(entry)
        for value in data.values.values()
        for entry in (value if isinstance(value, list | np.ndarray) else [value])
        if isinstance(entry, dict) and _KIND in entry
    ]


def _restored(entry: Mapping[str, Value]) -> StoredObject:
    try:
        stored = json.loads(str(entry[_ATTRIBUTES]))
        arrays = {name: np.asarray(entry[name[:_MAX_NAME]]).reshape(shape) for name, shape in stored["shapes"].items()}
        return StoredObject(str(entry[_KIND]), arrays, stored["attributes"])
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise ImportFailed(
            f"the structure of kind {entry[_KIND]!s} was changed: {error}; its arrays must keep their names and sizes, "
            "or give a mapping"
        ) from None
