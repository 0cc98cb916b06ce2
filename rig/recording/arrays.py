"""Arrays with attributes in one HDF5 file: models and imported measurements."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rig.errors import RecordingError
from rig.recording.compression import COMPRESSED, shrinks
from rig.recording.journal import journal_path
from rig.recording.journal_blocks import JournalBlocks
from rig.recording.layout import identify, kind_in, new_file, open_file, reading
from rig.recording.tables import StoredTexts, write_object
from vibrolock.printable import error_text

if TYPE_CHECKING:
    import h5py

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*\Z")
_COMPRESSED_FROM_BYTES = 65536  # smaller arrays gain nothing; chosen
_TRIED = 8192  # values in the middle by which it is judged whether compression pays; chosen


def write_arrays(
    path: str | Path, kind: str, arrays: Mapping[str, ArrayLike], attributes: Mapping[str, object]
) -> None:
    """Write arrays of numbers or texts and JSON-able attributes to ``path``, whole or not at all.

    Names are letters, digits and underscores, with ``/`` between groups.

    Raises:
        RecordingError: a name or an array that cannot be stored, attributes that are not JSON, or no way to write
            ``path``, which is then as it was.
    """
    path = Path(path)
    try:
        plain = {name: np.asarray(values) for name, values in arrays.items()}
    except ValueError as error:
        raise RecordingError(f"{path}: an array has rows of unequal length ({error_text(error)})") from error
    for name, values in plain.items():
        if not _NAME.match(name):
            raise RecordingError(
                f"{path}: array name {name!r} must be letters, digits, underscores and / between groups"
            )
        if values.dtype.kind not in "biufcU":
            raise RecordingError(f"{path}: array {name!r} is {values.dtype}; numbers or texts are expected")
        if group := next((other for other in plain if other.startswith(f"{name}/")), None):
            raise RecordingError(f"{path}: array name {name!r} is also the group of {group!r}")
    with new_file(path, kept="nothing was changed") as (file, check):
        identify(file, kind)
        write_object(file, "attributes", attributes)
        group = file.create_group("arrays")
        for name, values in plain.items():
            _write_array(group, name, values)
            check()


def _write_array(group: "h5py.Group", name: str, values: np.ndarray) -> None:
    import h5py

    if values.dtype.kind == "U":
        group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype("utf-8"))
    else:
        large = values.ndim > 0 and values.nbytes >= _COMPRESSED_FROM_BYTES
        middle = values.reshape(-1)[max(values.size - _TRIED, 0) // 2 :][:_TRIED]
        group.create_dataset(name, data=values, **(COMPRESSED if large and shrinks(middle) else {}))


def read_arrays(path: str | Path) -> tuple[str, dict[str, np.ndarray], dict[str, Any]]:
    """Read back what ``write_arrays`` wrote.

    Returns:
        Kind, arrays by name, attributes.

    Raises:
        RecordingError: missing, not ours, truncated, damaged, of a later schema, or a recording.
    """
    path = Path(path)
    with open_file(path) as file, reading(path):
        kind = kind_in(file)
        if "arrays" not in file:
            raise RecordingError(f"{path}: holds no arrays; it is a recording of kind {kind!r}")
        arrays: dict[str, np.ndarray] = {}
        texts = StoredTexts(path.stat().st_size)
        _collect(file["arrays"], "", arrays, texts)
        return kind, arrays, texts.object(file, "attributes")


def _collect(group: "h5py.Group", prefix: str, arrays: dict[str, np.ndarray], texts: StoredTexts) -> None:
    for name, item in group.items():
        if hasattr(item, "items"):
            _collect(item, f"{prefix}{name}/", arrays, texts)
        else:
            arrays[prefix + name] = texts.array(item) if item.dtype.kind in "SO" else np.asarray(item[()])


def kind_of(path: str | Path) -> str:
    """Read the kind of any file of ours: a recording (also one that is still a journal), a model, a measurement.

    Raises:
        RecordingError: missing, not ours, truncated, or of a later schema.
    """
    path = Path(path)
    if not path.exists() and journal_path(path).exists():
        return JournalBlocks(journal_path(path)).header.kind
    with open_file(path) as file, reading(path):
        return kind_in(file)
