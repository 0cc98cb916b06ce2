"""Messages of a DBC file compiled to numpy dtypes: what cantools reads once at the start, numpy decodes from then on."""

import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cantools
import numpy as np

from rig.errors import ConfigurationError

__all__ = ["CompiledMessage", "Layout", "compile_layout", "compile_text"]

_STRUCT_CODES = {
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

    def physical(self, data: bytes) -> np.ndarray:
        """The scaled values of a frame, float64[n_signals] in the order of `signals`."""
        alike, first, count = self._alike
        if alike is not None:
            raw = np.frombuffer(data, alike, count, first)
        else:
            raw = np.array(self.decode(data).tolist(), np.float64)
        values: np.ndarray = raw * self.scale
        return values + self.offset if self._has_offset else values

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
            out += f"{at - end}x" * (at > end) + _STRUCT_CODES[kind.str[1:]]
            end = at + kind.itemsize
        return out + f"{self.length - end}x" * (self.length > end)

    def _field(self, name: str) -> tuple[np.dtype[Any], int]:
        fields = self.dtype.fields
        assert fields is not None
        return fields[name][0], fields[name][1]

    def _described(self, name: str) -> str:
        kind, at = self._field(name)
        return f"{name}:{'big-endian ' * (kind.byteorder == '>')}{kind.name}@{at}"

    @cached_property
    def _has_offset(self) -> bool:
        return bool(self.offset.any())

    @cached_property
    def _alike(self) -> tuple[np.dtype[Any] | None, int, int]:
        """One type for all signals and the first byte, where they are of one type and side by side."""
        kind, first = self._field(self.signals[0])
        for place, name in enumerate(self.signals):
            if self._field(name) != (kind, first + place * kind.itemsize):
                return None, 0, 0
        return kind, first, len(self.signals)

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


def compile_layout(path: str | Path) -> Layout:
    """The layout that a DBC file defines.

    Raises `ConfigurationError`, naming file, message and signal, for what cannot be read or compiled.
    """
    try:
        text = Path(path).read_text(encoding="cp1252")  # the encoding of DBC files
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from None
    return compile_text(text, str(path))


def compile_text(text: str, source: str = "definition") -> Layout:
    """The layout in the text of a DBC file; ``source`` names it in errors."""
    try:
        database: Any = cantools.database.load_string(text, "dbc")
    except Exception as error:  # cantools has no common base for what a broken file may raise
        line = " ".join(str(error).split())
        raise ConfigurationError(f"{source}: is not a DBC file: {line}") from None
    messages = (message for message in database.messages if message.frame_id != 0x40000000 and message.signals)
    return Layout({message.name: _compiled(message, source) for message in messages})


def _compiled(message: Any, source: str) -> CompiledMessage:
    where = f"{source}: message {message.name}"
    if message.is_multiplexed():
        raise ConfigurationError(f"{where}: is multiplexed, which cannot be compiled")
    if message.is_extended_frame:
        raise ConfigurationError(f"{where}: has an identifier of 29 bits, allowed is 11")
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


def _first_byte(signal: Any, where: str) -> int:
    """Place of a signal; a big-endian one starts at the highest bit of its first byte."""
    little = signal.byte_order == "little_endian"
    if signal.start % 8 != (0 if little else 7):
        raise ConfigurationError(
            f"{where}, signal {signal.name}: starts at bit {signal.start}, allowed is a whole byte"
        )
    return int(signal.start) // 8


def _format(signal: Any, where: str) -> str:
    n_bytes, rest = divmod(signal.length, 8)
    kind = "f" if signal.is_float else "i" if signal.is_signed else "u"
    if rest or f"{kind}{n_bytes}" not in _STRUCT_CODES:
        allowed = "32 or 64" if signal.is_float else "8, 16, 32 or 64"
        raise ConfigurationError(f"{where}, signal {signal.name}: has {signal.length} bits, allowed is {allowed}")
    return f"{'<' if signal.byte_order == 'little_endian' else '>'}{kind}{n_bytes}"
