"""What an object file (ELF) holds: bytes of code and constants, and the names that it leaves open."""

import struct
from typing import NamedTuple

_HEADERS = {1: ("<HHIIIIIHHHHHH", "<IIIIIIIIII", "<IIIBBH"), 2: ("<HHIQQQIHHHHHH", "<IIQQQQIIQQ", "<IBBHQQ")}
"""Formats of the file's header, a section's and a symbol, by class: 32 or 64 bits, little end first."""
_IDENTITY = 16  # bytes before the file's header
_CODE, _ALLOCATED, _WRITTEN, _NO_BITS, _SYMBOLS = 4, 2, 1, 8, 2


class ObjectFacts(NamedTuple):
    """Sizes and names of an object file."""

    code: int
    """Bytes of machine code."""
    constants: int
    """Bytes of constants, tables for unwinding included."""
    data: int
    """Bytes of variables."""
    undefined: tuple[str, ...]
    """Names that must be linked, sorted."""


def read_object(content: bytes) -> ObjectFacts:
    """Return what an object file holds. Raises ValueError if it is no ELF file with the little end first."""
    if content[:4] != b"\x7fELF" or content[4] not in _HEADERS or content[5] != 1:
        raise ValueError("is no ELF file with the little end first")
    of_file, of_section, of_symbol = _HEADERS[content[4]]
    head = struct.unpack_from(of_file, content, _IDENTITY)
    at, size, count = head[5], head[10], head[11]
    sections = [struct.unpack_from(of_section, content, at + size * index) for index in range(count)]
    sums = {"code": 0, "constants": 0, "data": 0}
    undefined: set[str] = set()
    for _, kind, flags, _, begin, length, link, *_ in sections:
        if flags & _ALLOCATED:
            sums["code" if flags & _CODE else "data" if flags & _WRITTEN or kind == _NO_BITS else "constants"] += length
        elif kind == _SYMBOLS:
            names = content[sections[link][4] :]
            undefined |= set(_undefined(content[begin : begin + length], names, of_symbol, content[4] == 1))
    return ObjectFacts(sums["code"], sums["constants"], sums["data"], tuple(sorted(undefined)))


def _undefined(table: bytes, names: bytes, of_symbol: str, short: bool) -> list[str]:
    symbols = list(struct.iter_unpack(of_symbol, table))
    places = [symbol[0] for symbol in symbols if symbol[5 if short else 3] == 0 and symbol[0]]
    return [names[place : names.index(b"\0", place)].decode() for place in places]
