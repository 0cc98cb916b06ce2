"""DBC files compiled to layouts: read once at the start by cantools."""

from pathlib import Path
from typing import Any

import cantools
import numpy as np

from rig.errors import ConfigurationError
from rig.system.text_files import read_text
from rig.wire.can.layout import STRUCT_CODES, CompiledMessage, Layout

__all__ = ["compile_layout", "compile_text"]

LARGEST_DBC_BYTES = 10_000_000


def compile_layout(path: str | Path) -> Layout:
    """The layout that a DBC file defines.

    Raises `ConfigurationError`, naming file, message and signal, for what cannot be read or compiled.
    """
    text = read_text(Path(path), LARGEST_DBC_BYTES, encoding="cp1252")  # the encoding of DBC files
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
    if rest or f"{kind}{n_bytes}" not in STRUCT_CODES:
        allowed = "32 or 64" if signal.is_float else "8, 16, 32 or 64"
        raise ConfigurationError(f"{where}, signal {signal.name}: has {signal.length} bits, allowed is {allowed}")
    return f"{'<' if signal.byte_order == 'little_endian' else '>'}{kind}{n_bytes}"
