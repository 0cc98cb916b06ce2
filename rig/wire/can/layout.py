"""Layouts of CAN messages as numpy dtypes, compiled from DBC files; they convert frames to values and back."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig.errors import ConfigurationError
from rig.system.text_files import read_text
from rig.wire.can.lean_import import lean_import

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

STRUCT_CODES = {
    "u1": "B",
    "i1": "b",
    "u2": "H",
    "i2": "h",
    "u4": "I",
    "i4": "i",
    "u8": "Q",
    "i8": "q",
    "f4": "f",
    "f8": "d",
}
"""Kinds of signals that can be compiled, without their byte order: codes of `struct`."""


class _Run(NamedTuple):
    """Signals of one type side by side."""

    kind: np.dtype[np.number]
    first: int
    """Byte at which they begin."""
    n_signals: int
    place: slice
    """Where they are among all signals."""


@dataclass(frozen=True)
class CompiledMessage:
    """A message whose signals are whole numbers or floats on byte boundaries."""

    name: str
    frame_id: int
    length: int
    """Bytes."""
    fd: bool
    dtype: np.dtype[np.void]
    """A field for every signal, in the order of their first bytes; itemsize is the length."""
    scale: np.ndarray
    """Physical value of one count, float64[n_signals]."""
    offset: np.ndarray
    """Physical value of zero counts, float64[n_signals]."""

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals, in the order of the fields."""
        return tuple(self.dtype.names or ())

    def decode(self, data: bytes) -> np.void:
        """The raw values of a frame, by name: a record. Raises `ValueError` for fewer bytes than the message has."""
        record: np.void = np.frombuffer(data, self.dtype, 1)[0]
        return record

    @cached_property
    def physical(self) -> Callable[[bytes], np.ndarray]:
        """Takes a frame to its scaled values, float64[n_signals] in the order of `signals`; for one thread at a time.

        Raises `ValueError` for any other number of bytes than the message has.
        """
        data = memoryview(
            bytearray(self.length)
        )  # the views below read this buffer, so that a frame costs no allocation but the values
        views = [np.frombuffer(data, run.kind, run.n_signals, run.first) for run in self._runs]
        scale, offset = self.scale, self.offset if self.offset.any() else None
        if len(views) == 1:
            raw, copies = views[0], []
        else:
            raw = np.empty(len(self.signals))
            copies = [(raw[run.place], view) for run, view in zip(self._runs, views, strict=True)]

        def values_of(frame: bytes) -> np.ndarray:
            data[:] = frame
            for part, view in copies:
                part[:] = view
            values: np.ndarray = raw * scale
            if offset is not None:
                values += offset
            return values

        return values_of

    def physical_values(self, frames: Sequence[bytes]) -> np.ndarray:
        """The scaled values of many frames, float64[n_frames, n_signals]. Raises `ValueError` like `physical`."""
        data = np.frombuffer(b"".join(frames), np.uint8).reshape(len(frames), self.length)
        values = np.empty((len(frames), len(self.signals)))
        for run in self._runs:
            values[:, run.place] = data[:, run.first : run.first + run.n_signals * run.kind.itemsize].view(run.kind)
        values *= self.scale
        values += self.offset
        return values

    def encode(self, *values: int | float) -> bytes:
        """A frame's data from raw values in the order of `signals`; bytes of no signal are 0."""
        data = np.zeros(1, self.dtype)
        data[0] = values
        return data.tobytes()

    @cached_property
    def format(self) -> str:
        """The same layout for `struct`, where all signals are little-endian; faster than a dtype for a handful of signals."""
        out, end = "<", 0
        for name in self.signals:
            kind, at = self._field(name)
            out += f"{at - end}x" * (at > end) + STRUCT_CODES[kind.str[1:]]
            end = at + kind.itemsize
        return out + f"{self.length - end}x" * (self.length > end)

    def _field(self, name: str) -> tuple[np.dtype[np.number], int]:
        fields = self.dtype.fields
        assert fields is not None
        return fields[name][0], fields[name][1]

    def _described(self, name: str) -> str:
        kind, at = self._field(name)
        return f"{name}:{'big-endian ' * (kind.byteorder == '>')}{kind.name}@{at}"

    @cached_property
    def _runs(self) -> tuple["_Run", ...]:
        runs: list[_Run] = []
        for place, name in enumerate(self.signals):
            kind, at = self._field(name)
            last = runs[-1] if runs else None
            if last is not None and last.kind == kind and at == last.first + last.n_signals * kind.itemsize:
                runs[-1] = last._replace(n_signals=last.n_signals + 1, place=slice(last.place.start, place + 1))
            else:
                runs.append(_Run(kind, at, 1, slice(place, place + 1)))
        return tuple(runs)

    @cached_property
    def canonical(self) -> str:
        """The layout in one line that depends on nothing else: no comments, units, scales or order of the file."""
        fields = " ".join(self._described(name) for name in self.signals)
        return f"{self.frame_id:03X} {self.name} {self.length} {'fd' if self.fd else 'classical'} {fields}"


@dataclass(frozen=True)
class Layout:
    """All messages of a definition."""

    messages: dict[str, CompiledMessage]
    """By name."""

    @cached_property
    def crc(self) -> int:
        """CRC-32 over the canonical lines in the order of their identifiers, joined by line feeds."""
        ordered = sorted(self.messages.values(), key=lambda message: message.frame_id)
        return zlib.crc32("\n".join(message.canonical for message in ordered).encode("ascii"))


LARGEST_DBC_BYTES = 10_000_000
"""Largest DBC file that is read, bytes; chosen: a hundred times the definition of a large vehicle bus."""


def compile_layout(path: str | Path) -> Layout:
    """The layout that a DBC file defines.

    Raises `ConfigurationError`, naming file, message and signal, for what cannot be read or compiled.
    """
    text = read_text(Path(path), LARGEST_DBC_BYTES, encoding="cp1252")  # the encoding of DBC files
    return compile_text(text, str(path))


def compile_text(text: str, source: str = "definition") -> Layout:
    """The layout in the text of a DBC file; ``source`` names it in errors."""
    with lean_import():
        import cantools

    try:
        database = cantools.database.can.Database()
        database.add_dbc_string(text)
    except Exception as error:  # cantools has no common base for what a broken file may raise
        line = " ".join(str(error).split())
        raise ConfigurationError(f"{source}: is not a DBC file: {line}") from None
    messages = (message for message in database.messages if message.frame_id != 0x40000000 and message.signals)
    return Layout({message.name: _compiled(message, source) for message in messages})


def _compiled(message: "Message", source: str) -> CompiledMessage:
    where = f"{source}: message {message.name}"
    if message.is_multiplexed():
        raise ConfigurationError(f"{where}: is multiplexed, which cannot be compiled")
    ConfigurationError.raise_if(message.is_extended_frame, "has an identifier of 29 bits", where=where, allowed="11")
    placed = sorted(((_first_byte(signal, where), signal) for signal in message.signals), key=lambda pair: pair[0])
    formats = [_format(signal, where) for _, signal in placed]
    dtype = np.dtype(
        {
            "names": [signal.name for _, signal in placed],
            "formats": formats,
            "offsets": [first for first, _ in placed],
            "itemsize": message.length,
        }
    )
    scale = np.array([float(signal.scale) for _, signal in placed])
    offset = np.array([float(signal.offset) for _, signal in placed])
    return CompiledMessage(message.name, message.frame_id, message.length, bool(message.is_fd), dtype, scale, offset)


def _first_byte(signal: "Signal", where: str) -> int:
    """Place of a signal; a big-endian one starts at the highest bit of its first byte."""
    little = signal.byte_order == "little_endian"
    if signal.start % 8 != (0 if little else 7):
        raise ConfigurationError(
            f"{where}, signal {signal.name}: starts at bit {signal.start}, allowed is a whole byte"
        )
    return int(signal.start) // 8


def _format(signal: "Signal", where: str) -> str:
    n_bytes, rest = divmod(signal.length, 8)
    kind = "f" if signal.is_float else "i" if signal.is_signed else "u"
    if rest or f"{kind}{n_bytes}" not in STRUCT_CODES:
        allowed = "32 or 64" if signal.is_float else "8, 16, 32 or 64"
        raise ConfigurationError(f"{where}, signal {signal.name}: has {signal.length} bits, allowed is {allowed}")
    return f"{'<' if signal.byte_order == 'little_endian' else '>'}{kind}{n_bytes}"
