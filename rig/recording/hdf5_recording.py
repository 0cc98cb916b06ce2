"""The HDF5 layout of a recording, written and read (described for other programs in ``docs/reference/file-format.md``)."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from rig.errors import RecordingError
from rig.recording.compression import COMPRESSED, shrinks
from rig.recording.header import Column, Header
from rig.recording.integrity import VERIFIED
from rig.recording.layout import file_integrity, identify, kind_in, open_unchecked, reading
from rig.recording.parts import Part, rows_at_once
from rig.recording.stored import Configuration, End, Event, Information
from rig.recording.tables import StoredTexts, write_object, write_table

if TYPE_CHECKING:
    import h5py

_CHECKED: dict[str, str | bool] = {"fletcher32": True}
_TAKEN_OVER = "taken over from an unverified file"


class StoredPart(Part):
    """A part in an open HDF5 file, its group ``/parts/N``."""

    def __init__(self, group: "h5py.Group", texts: StoredTexts, path: Path) -> None:
        self._group, self._path = group, path
        self.information = cast(Information, texts.object(group, "information"))
        self.points = texts.table(group, "points")
        self.events = cast(list[Event], texts.table(group, "events"))
        self.end = cast(End, texts.object(group, "end")) if "end" in group else None
        columns = texts.table(group, "columns")
        self.columns = tuple(Column(c["name"], c["unit"], c["description"]) for c in columns)
        self.row_dtype = np.dtype([(c["name"], c["dtype"], tuple(c["shape"])) for c in columns])
        self.n_rows = int(group.attrs["n_rows"])
        self.dropped_bytes = int(group.attrs["dropped_bytes"])
        self.dropped_reason = str(group.attrs["dropped_reason"])
        for name in self.row_dtype.names or ():
            values, wanted = group["rows"][name], self.row_dtype[name]
            if values.shape != (self.n_rows, *wanted.shape) or values.dtype != wanted.base:
                raise RecordingError(f"{path}: damaged: {values.name} is {values.dtype} of shape {values.shape}")

    def _read_rows(self, start: int, stop: int) -> np.ndarray:
        rows = np.empty(stop - start, self.row_dtype)
        for name in self.row_dtype.names or ():
            rows[name] = self._read_field(name, start, stop)
        return rows

    def _read_field(self, field: str, start: int, stop: int) -> np.ndarray:
        if not self._group:
            raise RecordingError(f"{self._path}: is closed")
        with reading(self._path):
            values: np.ndarray = self._group["rows"][field][start:stop]
            return values


def opened_recording(path: Path) -> "tuple[h5py.File, str]":
    """Open the file of a recording as `rig.recording.layout.open_file`; return it with its integrity.

    A recording that took parts over from an unverified file is unverified for good.
    """
    found, file = file_integrity(path), open_unchecked(path)
    if found == VERIFIED and "unverified" in file.attrs:
        found = f"unverified: {file.attrs['unverified']}"
    return file, found


def taken_over(integrity: str, n_parts: int) -> str:
    """Why a new file that takes over ``n_parts`` of a file with this ``integrity`` is unverified; empty if it is verified."""
    if integrity == VERIFIED or n_parts == 0:
        return ""
    told = integrity.removeprefix("unverified: ")
    return told if told.startswith(_TAKEN_OVER) else f"{_TAKEN_OVER}: parts 0 to {n_parts - 1}: {told}"


def write_recording(
    file: "h5py.File", header: Header, parts: Iterable[Part], check: Callable[[], None], unverified: str = ""
) -> None:
    """Write a whole recording into an open new file; ``check`` raises once the disk is full."""
    identify(file, header.kind)
    if unverified:
        file.attrs["unverified"] = unverified
    for name in ("software_version", "started", "identity"):
        file.attrs[name] = getattr(header, name)
    if header.seed is not None:
        file.attrs["seed"] = np.uint64(header.seed)
    write_object(file, "configuration", header.configuration)
    write_table(file, "channels", header.channels)
    group = file.create_group("parts")
    for number, part in enumerate(parts):
        _write_part(group.create_group(str(number)), part, check)


def _write_part(group: "h5py.Group", part: Part, check: Callable[[], None]) -> None:
    group.attrs["n_rows"], group.attrs["dropped_bytes"] = part.n_rows, part.dropped_bytes
    group.attrs["dropped_reason"] = part.dropped_reason
    write_object(group, "information", part.information)
    write_table(group, "points", part.points)
    write_table(group, "events", part.events)
    if part.end is not None:
        write_object(group, "end", part.end)
    columns = [(column, part.row_dtype[column.name]) for column in part.columns]
    described = [{**vars(column), "dtype": field.base.str, "shape": list(field.shape)} for column, field in columns]
    write_table(group, "columns", described)
    step = rows_at_once(part.row_dtype)
    shrinking = _shrinking(part, step)
    datasets = {}
    for column, field in columns:
        compressed = COMPRESSED | _CHECKED if column.name in shrinking else {}
        storage = {"chunks": (min(step, part.n_rows), *field.shape), **compressed} if part.n_rows else {}
        dataset = group.create_dataset(f"rows/{column.name}", (part.n_rows, *field.shape), field.base, **storage)
        dataset.attrs["unit"], dataset.attrs["description"] = column.unit, column.description
        datasets[column.name] = dataset
    for start in range(0, part.n_rows, step):
        stop = min(start + step, part.n_rows)
        rows = part.read(start, stop)
        for name, dataset in datasets.items():
            if name in shrinking:
                dataset[start:stop] = rows[name]
            else:
                at = (start, *(0,) * (dataset.ndim - 1))
                dataset.id.write_direct_chunk(at, _whole_chunk(rows[name], dataset.chunks))
        check()


def _shrinking(part: Part, step: int) -> set[str]:
    """Names of the fields that are worth compressing, judged by a chunk in the middle of a part."""
    names = set(part.row_dtype.names or ())
    if part.n_rows < step:
        return names
    first = part.n_rows // step // 2 * step
    rows = part.read(first, min(first + step, part.n_rows))
    return {name for name in names if rows[name].dtype.kind not in "fc" or shrinks(rows[name], **_CHECKED)}


def _whole_chunk(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the values as one chunk, the last of which ends with zeros."""
    if values.shape == shape:
        return np.ascontiguousarray(values)
    chunk = np.zeros(shape, values.dtype)
    chunk[: len(values)] = values
    return chunk


def read_recording(file: "h5py.File", path: Path) -> tuple[Header, list[StoredPart]]:
    """Read an open recording; its rows stay in the file.

    Returns:
        Header, with rows as in the last part and ``first_part`` the number of parts; and the parts.

    Raises:
        RecordingError: it is a file of another kind, or damaged.
    """
    with reading(path):
        if "parts" not in file:
            raise RecordingError(f"{path}: is not a recording but a file of kind {kind_in(file)!r}")
        texts = StoredTexts(path.stat().st_size)
        parts = [StoredPart(file["parts"][str(number)], texts, path) for number in range(len(file["parts"]))]
        header = Header(
            kind=kind_in(file),
            configuration=cast(Configuration, texts.object(file, "configuration")),
            channels=texts.table(file, "channels"),
            row_dtype=parts[-1].row_dtype,
            columns=parts[-1].columns,
            software_version=str(file.attrs["software_version"]),
            started=str(file.attrs["started"]),
            seed=int(file.attrs["seed"]) if "seed" in file.attrs else None,
            first_part=len(parts),
            identity=str(file.attrs["identity"]),
        )
    return header, parts
