"""MAT files of version 7.3, which are HDF5 files with attributes of MATLAB, as SciPy returns those of earlier versions.

Arrays are stored with their dimensions reversed, texts as codes, cells and arrays of structures as references. As with earlier
versions, dimensions of length 1 are left out.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.exchange.file_data import Value
from rig.exchange.foreign.hdf5 import MAX_DEPTH, Budget

if TYPE_CHECKING:
    import h5py


def read_matlab_hdf5(path: Path) -> dict[str, Value]:
    """Return the variables of a file; raise OSError, ValueError or errors of h5py if it cannot be read."""
    import h5py

    budget = Budget(path)
    with h5py.File(path, "r") as file:
        return {
            name: _link(file, name, file, budget, 0)
            for name in file
            if not name.startswith("#") and not isinstance(file.get(name, getlink=True), h5py.ExternalLink)
        }


def _link(group: "h5py.Group", name: str, file: "h5py.File", budget: Budget, depth: int) -> Value:
    import h5py

    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        return "<link to another file>"
    return _value(group[name], file, budget, depth)


def _value(item: "h5py.Group | h5py.Dataset", file: "h5py.File", budget: Budget, depth: int) -> Value:
    """Return a variable, a field or a cell."""
    import h5py

    if depth > MAX_DEPTH:
        raise ValueError(f"it is nested deeper than {MAX_DEPTH}")
    if isinstance(item, h5py.Group):
        return _structure(item, file, budget, depth)
    if item.is_virtual or item.external:
        return "<data in another file>"
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    if item.shape is None or item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.zeros(0)
    budget.spend(int(np.prod(item.shape, dtype=float)) * item.dtype.itemsize)
    if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
        cells = np.squeeze(item[()].T)
        return _cells(cells, file, budget, depth)
    stored = item[()]
    if kind == "char":
        return _text(stored)
    if stored.dtype.names is not None:
        if set(stored.dtype.names) != {"real", "imag"}:
            return f"<{stored.dtype}>"
        stored = stored["real"] + 1j * stored["imag"]
    if stored.dtype.kind not in "biufc":
        return f"<{stored.dtype}>"
    array = np.squeeze(np.ascontiguousarray(stored.T))
    array = array.astype(bool) if kind == "logical" else array
    return array[()] if array.ndim == 0 else array


def _structure(group: "h5py.Group", file: "h5py.File", budget: Budget, depth: int) -> Value:
    """Return a structure, or an array of structures, whose fields are references to the values of each."""
    import h5py

    fields = {name: group[name] for name in group if not isinstance(group.get(name, getlink=True), h5py.ExternalLink)}
    listed = {
        name: item
        for name, item in fields.items()
        if isinstance(item, h5py.Dataset)
        and "MATLAB_class" not in item.attrs
        and h5py.check_ref_dtype(item.dtype) is h5py.Reference
    }
    budget.spend(0)
    if not fields or len(listed) < len(fields):
        return {name: _link(group, name, file, budget, depth + 1) for name in fields}
    values = {name: _list(item, file, budget, depth) for name, item in listed.items()}
    count = min(map(len, values.values()))
    return [{name: several[index] for name, several in values.items()} for index in range(count)]


def _list(item: "h5py.Group | h5py.Dataset", file: "h5py.File", budget: Budget, depth: int) -> list[Value]:
    return [_value(file[reference], file, budget, depth + 1) for reference in np.ravel(item[()].T, order="F")]


def _cells(cells: NDArray[np.generic], file: "h5py.File", budget: Budget, depth: int) -> Value:
    found = np.empty(np.shape(cells), dtype=object)
    for index, reference in np.ndenumerate(cells):
        found[index] = _value(file[reference], file, budget, depth + 1)
    return found if found.ndim else found[()]


def _text(codes: NDArray[np.generic]) -> Value:
    """Return a row of codes as a text, several as a list of texts."""
    rows = np.atleast_2d(np.asarray(codes).T)
    texts: list[Value] = ["".join(map(chr, row.astype(np.uint32))) for row in rows]
    return texts[0] if len(texts) == 1 else texts
