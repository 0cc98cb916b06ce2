"""MAT files of version 7.3, which are HDF5 files with attributes of MATLAB, as SciPy returns those of earlier versions.

Arrays are stored with their dimensions reversed, texts as codes, cells and arrays of structures as references. As with earlier
versions, dimensions of length 1 are left out.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.exchange.file_data import Value
from rig.exchange.foreign.hdf5 import MAX_DEPTH, Budget, is_link_out

if TYPE_CHECKING:
    import h5py

_DECODED = "MATLAB_object_decode"
"""Attribute of an object, whose numbers are references into a part of the file that MATLAB does not document."""


def read_matlab_hdf5(path: Path) -> dict[str, Value]:
    """Return the variables of a file; raise OSError, ValueError or errors of h5py if it cannot be read."""
    import h5py

    with h5py.File(path, "r") as file:
        reader = _Reader(file, Budget(path))
        names = [name for name in file if not name.startswith("#") and not is_link_out(file, name)]
        return {name: reader.value(file[name], 0) for name in names}


def objects_in(path: Path) -> dict[str, str]:
    """Return the names of the variables that are objects of MATLAB, and their classes."""
    import h5py

    with h5py.File(path, "r") as file:
        names = [name for name in file if not name.startswith("#") and not is_link_out(file, name)]
        return {name: _class(file[name]) for name in names if _DECODED in file[name].attrs}


def _class(item: "h5py.Group | h5py.Dataset") -> str:
    kind = item.attrs.get("MATLAB_class", b"")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


class _Reader:
    """Reads the values of one file, as far as its budget allows."""

    def __init__(self, file: "h5py.File", budget: Budget) -> None:
        self._file, self._budget = file, budget

    def value(self, item: "h5py.Group | h5py.Dataset", depth: int) -> Value:
        """Return a variable, a field or a cell."""
        import h5py

        if depth > MAX_DEPTH:
            raise ValueError(f"it is nested deeper than {MAX_DEPTH}")
        if isinstance(item, h5py.Group):
            return self._structure(item, depth)
        if item.is_virtual or item.external:
            return "<data in another file>"
        kind = _class(item)
        if _DECODED in item.attrs:
            return f"<MATLAB {kind}>"
        if item.shape is None or item.attrs.get("MATLAB_empty", 0):
            return "" if kind == "char" else np.zeros(0)
        self._budget.spend(int(np.prod(item.shape, dtype=float)) * item.dtype.itemsize)
        stored = item[()]
        if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
            return self._cells(np.squeeze(stored.T), depth)
        if kind == "char":
            rows = np.moveaxis(np.atleast_2d(np.asarray(stored).T), 1, -1)
            rows = rows.reshape(-1, rows.shape[-1])
            texts: list[Value] = ["".join(map(chr, row.astype(np.uint32))) for row in rows]
            return texts[0] if len(texts) == 1 else texts
        if stored.dtype.names is not None and set(stored.dtype.names) == {"real", "imag"}:
            stored = stored["real"] + 1j * stored["imag"]
        if stored.dtype.kind not in "biufc":
            return f"<{stored.dtype}>"
        array = np.squeeze(np.ascontiguousarray(stored.T))
        array = array.astype(bool) if kind == "logical" else array
        return array[()] if array.ndim == 0 else array

    def _structure(self, group: "h5py.Group", depth: int) -> Value:
        """Return a structure, or an array of structures, whose fields are references to the values of each."""
        import h5py

        fields = {name: group[name] for name in group if not is_link_out(group, name)}
        self._budget.spend(0)
        listed = all(
            isinstance(item, h5py.Dataset)
            and "MATLAB_class" not in item.attrs
            and h5py.check_ref_dtype(item.dtype) is h5py.Reference
            for item in fields.values()
        )
        if not fields or not listed:
            return {name: self.value(item, depth + 1) for name, item in fields.items()}
        values = {
            name: [self.value(self._file[one], depth + 1) for one in np.ravel(item[()].T, order="F")]
            for name, item in fields.items()
        }
        count = min(map(len, values.values()))
        return [{name: several[index] for name, several in values.items()} for index in range(count)]

    def _cells(self, cells: NDArray[np.generic], depth: int) -> Value:
        found = np.empty(np.shape(cells), dtype=object)
        for index, reference in np.ndenumerate(cells):
            found[index] = self.value(self._file[reference], depth + 1)
        return found if found.ndim else found[()]
