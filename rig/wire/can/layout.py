"""Layouts of CAN messages as formats of `struct` and in canonical lines, compiled from DBC files."""

import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.errors import ConfigurationError
from rig.system.text_files import read_text
from rig.wire.can.lean_import import lean_import

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

STRUCT_CODES = dict(zip(["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"], "BbHhIiQqfd", strict=True))
"""Kinds of signals that can be compiled, without their byte order: codes of `struct`."""


@dataclass(frozen=True)
class CompiledMessage:
    """A message whose signals are whole numbers or floats on byte boundaries."""

    name: str
    frame_id: int
    length: int
    """Bytes."""
    fd: bool
    placed: tuple[tuple[str, np.dtype[np.number], int], ...]
    """Name, type and first byte of every signal, in the order of their first bytes."""

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals, in the order of their first bytes."""
        return tuple(name for name, _, _ in self.placed)

    @cached_property
    def format(self) -> str:
        """The same layout for `struct`, where all signals are little-endian; faster than a dtype for a handful of signals."""
        out, end = "<", 0
        for _, kind, at in self.placed:
            out += f"{at - end}x" * (at > end) + STRUCT_CODES[kind.str[1:]]
            end = at + kind.itemsize
        return out + f"{self.length - end}x" * (self.length > end)

    @cached_property
    def canonical(self) -> str:
        """The layout in one line that depends on nothing else: no comments, units, scales or order of the file."""
        fields = " ".join(
            f"{name}:{'big-endian ' * (kind.byteorder == '>')}{kind.name}@{at}" for name, kind, at in self.placed
        )
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
    ConfigurationError.raise_if(message.is_multiplexed(), f"{where}: is multiplexed, which cannot be compiled")
    ConfigurationError.raise_if(message.is_extended_frame, "has an identifier of 29 bits", where=where, allowed="11")
    placed = [(signal.name, _type(signal, where), _first_byte(signal, where)) for signal in message.signals]
    ordered = tuple(sorted(placed, key=lambda one: one[2]))
    return CompiledMessage(message.name, message.frame_id, message.length, bool(message.is_fd), ordered)


def _first_byte(signal: "Signal", where: str) -> int:
    """Place of a signal; a big-endian one starts at the highest bit of its first byte."""
    little = signal.byte_order == "little_endian"
    if signal.start % 8 != (0 if little else 7):
        raise ConfigurationError(
            f"{where}, signal {signal.name}: starts at bit {signal.start}, allowed is a whole byte"
        )
    return int(signal.start) // 8


def _type(signal: "Signal", where: str) -> np.dtype[np.number]:
    n_bytes, rest = divmod(signal.length, 8)
    kind = "f" if signal.is_float else "i" if signal.is_signed else "u"
    if rest or f"{kind}{n_bytes}" not in STRUCT_CODES:
        allowed = "32 or 64" if signal.is_float else "8, 16, 32 or 64"
        raise ConfigurationError(f"{where}, signal {signal.name}: has {signal.length} bits, allowed is {allowed}")
    return np.dtype(f"{'<' if signal.byte_order == 'little_endian' else '>'}{kind}{n_bytes}")
