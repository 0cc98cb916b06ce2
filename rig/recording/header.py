"""Facts about a recording before its first row: the first block of a journal, the root of the HDF5 file."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rig.errors import RecordingError
from rig.recording import jsontext
from rig.recording.stored import Configuration, StoredTable

FORMAT = "vibrolock"
"""Value of the attribute ``format`` of every file."""

SCHEMA = 3
"""Version of the layout of journals and HDF5 files that this version writes; it reads all up to this one."""

_FACTS = ("schema", "kind", "software_version", "started", "seed", "identity", "first_part")
"""Fields of a header that are stored as they are."""
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_SCALARS = frozenset(np.dtype(code).newbyteorder("<") for code in ("?", *"bBhHiIqQ", *"efd", *"FD"))
_LARGEST_ROW = 65536  # bytes; chosen: a thousand times a usual row


def check_schema(schema: object, path: object) -> None:
    """Refuse a file of a later schema, or one whose schema is no positive integer, by ``RecordingError``."""
    if not isinstance(schema, int | np.integer) or isinstance(schema, bool) or schema < 1:
        raise RecordingError(f"{path}: damaged: schema {schema!r} is not a positive integer")
    if schema > SCHEMA:
        raise RecordingError(f"{path}: written by schema {schema}, this version reads up to {SCHEMA}; update vibrolock")


def packed(dtype: np.dtype) -> np.dtype:
    """Return the row as it is stored: the same fields in the same order, little-endian, without padding.

    Raises:
        RecordingError: not a structured dtype of plain numbers, or rows larger than 64 KiB.
    """
    if not dtype.names or not dtype.fields:
        raise RecordingError(f"row dtype: {dtype} has no fields; a structured dtype is expected")
    described: list[tuple[str, np.dtype, tuple[int, ...]]] = []
    for name in dtype.names:
        base, shape = dtype.fields[name][0].base.newbyteorder("<"), dtype.fields[name][0].shape
        if not _NAME.match(name):
            raise RecordingError(f"row dtype: field name {name!r} must be letters, digits and underscores")
        if base not in _SCALARS:
            raise RecordingError(f"row dtype: field {name!r} is {base}; boolean, integer, float or complex is expected")
        if 0 in shape:
            raise RecordingError(f"row dtype: field {name!r} of shape {shape} is empty")
        described.append((name, base, shape))
    row = np.dtype(described)
    if row.itemsize > _LARGEST_ROW:
        raise RecordingError(f"row dtype: {row.itemsize} bytes a row, at most {_LARGEST_ROW} are allowed")
    return row


@dataclass(frozen=True)
class Column:
    """Name, unit and meaning of one field of a row."""

    name: str
    unit: str
    """SI unit; ``"1"`` for a pure number."""
    description: str


@dataclass(frozen=True)
class Header:
    """Everything about a recording except its rows, points and events.

    Raises:
        RecordingError: on construction; the message names the field, the value and what is allowed.
    """

    kind: str
    """Kind of recording, for example ``"backbone"``."""
    configuration: Configuration
    """The whole configuration as it was (bench, plan), JSON-able."""
    channels: Sequence[StoredTable]
    """Channel table: one JSON-able mapping per input channel, in the order of the channel block of a row."""
    row_dtype: np.dtype
    """Structured dtype of one row; stored packed and little-endian."""
    columns: Sequence[Column]
    """One description for each field of ``row_dtype``, in its order."""
    software_version: str
    started: str
    """Start time as the caller gives it, ISO 8601 recommended."""
    seed: int | None = None
    """Seed of the noise of a virtual rig, 0 to 2**64 - 1; ``None`` for a real one."""
    first_part: int = 0
    """Number of parts that the HDF5 file beside the journal held when the journal was begun."""
    identity: str = field(default_factory=lambda: os.urandom(8).hex())
    """Random name that distinguishes this recording from others with the same path."""
    schema: int = field(default_factory=lambda: SCHEMA)
    """Schema of the journal that it was read from; a new one is always of the present schema."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "row_dtype", packed(np.dtype(self.row_dtype)))
        for name in ("kind", "software_version", "started", "identity"):
            text = getattr(self, name)
            if not isinstance(text, str) or not text or not text.isprintable():
                raise RecordingError(f"header: {name} is {text!r}; a printable text is expected")
        for name, highest in (("seed", 2**64 - 1), ("first_part", 2**31 - 1)):
            number = getattr(self, name)
            if number is None and name == "seed":
                continue
            if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number <= highest:
                raise RecordingError(f"header: {name} is {number!r}; an integer from 0 to {highest} is expected")
        described = tuple(column.name for column in self.columns)
        if described != self.row_dtype.names:
            raise RecordingError(f"header: columns describe {described}, the rows hold {self.row_dtype.names}")

    def encoded(self) -> bytes:
        """Return the header as JSON text."""
        row = self.row_dtype
        value = {
            "format": FORMAT,
            **{name: getattr(self, name) for name in _FACTS},
            "row_dtype": [[name, row[name].base.str, list(row[name].shape)] for name in row.names or ()],
            "columns": [[column.name, column.unit, column.description] for column in self.columns],
            "channels": [dict(channel) for channel in self.channels],
            "configuration": dict(self.configuration),
        }
        return jsontext.encode(value, what="header")

    @classmethod
    def decoded(cls, text: bytes, path: object) -> "Header":
        """Read the header in the JSON text of a journal's first block.

        Raises:
            RecordingError: another format, a later schema, or a damaged header; the message begins with ``path``.
        """
        try:
            value = jsontext.decode(text)
            if value.get("format") != FORMAT:
                raise RecordingError(f"{path}: not a recording of vibrolock")
            check_schema(value.get("schema"), path)
            return cls(
                **{name: value[name] for name in (*_FACTS, "configuration", "channels")},
                row_dtype=np.dtype([(name, base, tuple(shape)) for name, base, shape in value["row_dtype"]]),
                columns=tuple(Column(*texts) for texts in value["columns"]),
            )
        except (KeyError, TypeError, ValueError, MemoryError) as error:
            raise RecordingError(f"{path}: damaged: its header cannot be read ({error})") from error
