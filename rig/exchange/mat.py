"""MAT files of version 5, which MATLAB, Octave and SciPy read: one structure, or an array of structures.

A structure contains the arrays by name, ``units`` with the same names, ``channels`` if there are any, and two texts:
``vibrolock_kind``, and ``attributes_json`` with everything else that is needed to read the file back unchanged.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.exchange.beside import facts_beside, merged
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.file_data import ChannelFacts, FileData, StoredObject, Value, from_variables
from rig.exchange.spellings import factor_remark
from rig.text.contents import Contents

_KIND, _ATTRIBUTES = "vibrolock_kind", "attributes_json"
_MAX_DEPTH = 8  # levels of structures in which signals are looked for; chosen
_DATA, _NAMES_OF, _UNITS_OF = ("data", "values", "samples"), ("name", "label"), ("unit", "units")
"""Fields of a structure of one signal, in small letters."""
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

    from rig.exchange.foreign.matlab_hdf5 import objects_in, read_matlab_hdf5
    from rig.exchange.foreign.matlab_objects import opaque_in, read_objects

    try:
        variables: dict[str, Value] = loadmat(str(path), simplify_cells=True, appendmat=False)
        objects = opaque_in(variables)
    except NotImplementedError:  # version 7.3
        variables, objects = read_matlab_hdf5(path), objects_in(path)
    plain = {name: value for name, value in variables.items() if name not in objects}
    facts = dict(signals_described(plain))
    if objects:
        values, told = read_objects(path, objects, plain)
        plain, facts = {**plain, **values}, {**facts, **told}
    found = from_variables(plain)
    return replace(found, channels={**facts, **found.channels})


def signals_described(value: Value, path: str = "", depth: int = 0) -> Iterator[tuple[str, ChannelFacts]]:
    """Yield what structures say of the signals in them, by path.

    That are ``Data`` (or ``values``, ``samples``) with ``Name`` and ``Unit``, as dSPACE ControlDesk writes them: a structure
    ``X`` of the instants and structures ``Y`` of the signals; and ``force`` with ``force_unit``, or ``units.force``.
    """
    if depth > _MAX_DEPTH:
        return
    if isinstance(value, dict):
        name, unit = _text_at(value, _NAMES_OF), _text_at(value, _UNITS_OF)
        data = next((key for key in value if key.lower() in _DATA and isinstance(value[key], np.ndarray)), "")
        above = f"{path}." if path else ""
        beside = merged(from_variables(value).channels, facts_beside(value))
        if data and path and (name or unit):
            remarks = "; ".join(filter(None, (factor_remark(*pair, "beside it") for pair in value.items())))
            beside = merged(beside, {data: ChannelFacts(name=name, unit=unit, unread=remarks)})
        yield from ((f"{above}{key}", facts) for key, facts in beside.items())
        for key, item in value.items():
            yield from signals_described(item, f"{path}.{key}" if path else key, depth + 1)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 1):
        for index, item in enumerate(value):
            yield from signals_described(item, f"{path}[{index}]", depth + 1)


def _text_at(structure: Mapping[str, Value], keys: tuple[str, ...]) -> str:
    """Return the first text in a structure at one of the keys, in small letters; empty without one."""
    found = (value for key, value in structure.items() if key.lower() in keys and isinstance(value, str))
    return next(found, "")


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
