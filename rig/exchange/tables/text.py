"""Text of a table in the encoding in which its program wrote it, in blocks of whole lines."""

import codecs
import io
from collections.abc import Iterator
from pathlib import Path

from rig.exchange.child_reading import ImportFailed
from rig.system.text_files import open_regular

LARGEST_BYTES = 1_000_000_000  # largest file that is read, bytes; chosen
_BLOCK = 1 << 20  # bytes or characters that are read at once; chosen
_HEAD = 4096  # bytes by which UTF-16 without a mark is told; chosen
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_NO_TEXT = bytes({*range(32)} - {*b"\t\n\v\f\r\x1a\x1b"})  # control characters that no table has
_UTF8 = "utf-8-sig"
"""UTF-8, with or without its mark."""
_ANSI = "cp1252"
"""What Windows programs write in western Europe; it has the letters of Latin-1."""


def encoding_of(path: Path) -> str:
    """Return the encoding of a text: by its mark or by the zeros of UTF-16; UTF-8 if it is that; else that of Windows.

    Raises `ImportFailed` for what is no text.
    """
    with open_regular(path, LARGEST_BYTES, ImportFailed) as stream:
        block = stream.read(_HEAD)
        known = next((name for mark, name in _MARKS.items() if block.startswith(mark)), "") or _wide(block)
        if known:
            return known
        decoder, place, wrong, plain = codecs.getincrementaldecoder("utf-8")(), 0, "", True
        while True:
            if len(block.translate(None, _NO_TEXT)) < len(block):
                at = place + next(at for at, byte in enumerate(block) if byte in _NO_TEXT)
                raise ImportFailed(f"{path}: is not UTF-8 text ({wrong or f'byte {at}: a control character'})")
            try:
                if not wrong and not (plain := plain and block.isascii()):
                    decoder.decode(block, final=not block)
            except UnicodeDecodeError as error:
                wrong = f"byte {place + error.start}: {error.reason}"
            if not block:
                return _ANSI if wrong else _UTF8
            place += len(block)
            block = stream.read(_BLOCK)


def _wide(head: bytes) -> str:
    """Return the kind of UTF-16 without a mark: letters and digits have a zero as every second byte; else an empty text."""
    pairs = len(head) // 2
    for name, start in (("utf-16-le", 1), ("utf-16-be", 0)):
        zeros, others = head[start::2].count(0), head[1 - start :: 2].count(0)
        if pairs and zeros > 0.8 * pairs and not others:
            return name
    return ""


def blocks(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Yield blocks of whole lines with the number of their first line; lines end with a line feed, whatever the file has.

    Raises `ImportFailed` where the text is not in this encoding.
    """
    with open_regular(path, LARGEST_BYTES, ImportFailed) as stream:
        text, number = io.TextIOWrapper(stream, encoding=encoding, newline=None), 1
        try:
            while block := text.read(_BLOCK):
                block += text.readline()
                yield number, block
                number += block.count("\n")
        except UnicodeError as error:
            said = encoding.removesuffix("-sig").upper()
            reason = getattr(error, "reason", str(error))
            raise ImportFailed(f"{path}: is not {said} text (after line {number}: {reason})") from None


def table_lines(blocks: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither empty nor comments, with their numbers."""
    for first, block in blocks:
        for number, line in enumerate(block.split("\n"), first):
            if is_row(line):
                yield number, line


def is_row(line: str) -> bool:
    """Return whether a line is neither empty nor a comment."""
    return bool(line.strip(" \t\r\0\x1a")) and not line.startswith("#")
