"""MAT files of version 5, which MATLAB, Octave and SciPy read: one structure, or an array of them.

A structure holds the arrays by name, ``units`` of the same names, ``channels`` where there are any, and two texts:
``vibrolock_kind``, and ``attributes_json`` with everything else, from which the file is read back as it was.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from rig.errors import RigError
from rig.exchange.mat_process import read_values
from rig.system.child import ChildFailed, ask_child
from rig.text.contents import Contents

__all__ = ["ImportFailed", "read_mat", "structures_of_ours", "write_mat"]

_KIND, _ATTRIBUTES = "vibrolock_kind", "attributes_json"
_LONGEST = 31  # characters of a field's name that every reader of version 5 takes
_PATIENCE_S, _SLOWEST_BYTES_S = 60.0, 5e6


class ImportFailed(RigError):  # noqa: N818 (says what happened)
    """A file of measurements cannot be read, or does not hold what its mapping says; the message names both."""


def write_mat(items: Sequence[Contents], path: Path) -> None:
    """Write, under the name of each kind, one structure or a 1 x n array of them; may raise anything SciPy does."""
    from scipy.io import savemat

    kinds = dict.fromkeys(item.kind for item in items)
    variables = {
        kind.replace("-", "_"): _variable([_structure(item) for item in items if item.kind == kind]) for kind in kinds
    }
    savemat(str(path), variables, appendmat=False, oned_as="column", long_field_names=False)


def _variable(structures: Sequence[Mapping[str, Any]]) -> Any:
    """One structure as it is, several as an array."""
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
    """A unit as text, several as a cell array of the shape of what they belong to."""
    return unit if isinstance(unit, str) else np.asarray(unit).astype(object)


def _table(channels: Sequence[Mapping[str, str]]) -> Any:
    """Channels as a structure array."""
    table = np.empty(len(channels), dtype=[(key, object) for key in ("name", "role", "unit")])
    for row, channel in enumerate(channels):
        table[row] = (channel["name"], channel["role"], channel["unit"])
    return table


def read_mat(path: Path) -> dict[str, Any]:
    """Everything in a MAT file (up to version 7) as nested dictionaries, lists and arrays; raises `ImportFailed`.

    SciPy's parser crashes on some damaged files. So a child process reads it, in 4 GiB, for at most 60 s and 1 s per 5 MB.
    """
    if not path.is_file():
        raise ImportFailed(f"{path}: there is no such file")
    with TemporaryDirectory(prefix="vibrolock-") as folder:
        timeout_s = _PATIENCE_S + path.stat().st_size / _SLOWEST_BYTES_S
        try:
            why = ask_child("rig.exchange.mat_process", str(path.absolute()), folder, timeout_s=timeout_s)
        except ChildFailed as error:
            raise ImportFailed(f"{path}: is no MAT file, or a damaged one (reading it {error})") from None
        if why:
            raise ImportFailed(f"{path}: {why.decode()}")
        data: dict[str, Any] = read_values(Path(folder))
    return data


def structures_of_ours(data: Mapping[str, Any]) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Kind, arrays and attributes of every structure that `write_mat` wrote; raises `ImportFailed` on damaged ones."""
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
