"""The page on the wire protocol, read by somebody who has nothing else: its tables, COBS and CRC-32 as its words say."""

import json
import re
import struct

from tests.docs.pages import ROOT, blocks

PAGE = ROOT / "docs" / "reference" / "wire-protocol.md"
FORMATS = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q"}


def crc32(data: bytes) -> int:
    """Bit by bit: polynomial 0xEDB88320, begun with all ones, inverted at the end."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def cobs(data: bytes) -> bytes:
    """Every block begins with its distance to the next zero, at most 255; a zero is understood after the last byte."""
    out, code_at, distance = bytearray([0]), 0, 1
    for byte in data:
        if distance == 255:
            out[code_at], code_at, distance = 255, len(out), 1
            out.append(0)
        if byte:
            out.append(byte)
            distance += 1
        else:
            out[code_at], code_at, distance = distance, len(out), 1
            out.append(0)
    out[code_at] = distance
    return bytes(out)


def uncobs(encoded: bytes) -> bytes | None:
    """What was encoded; None where a distance leads beyond the end or to a zero."""
    out = bytearray()
    position = 0
    while position < len(encoded):
        distance = encoded[position]
        run = encoded[position + 1 : position + distance]
        if distance == 0 or 0 in run or len(run) != distance - 1:
            return None
        out += run
        position += distance
        if distance < 255 and position < len(encoded):
            out.append(0)
    return bytes(out)


def payload_of(encoded: bytes) -> bytes | None:
    """Header and body of a frame without its zero; None where it is damaged."""
    data = uncobs(encoded)
    if data is None or len(data) < 4 or crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
        return None
    return data[:-4]


def on_the_line(payload: bytes) -> bytes:
    """The bytes of a payload on the line, with the zero that ends them."""
    return cobs(payload + crc32(payload).to_bytes(4, "little")) + b"\0"


def sections() -> dict[str, str]:
    """Text below each heading of the page."""
    parts = re.split(r"^#+ (.*)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def fields(name: str) -> list[tuple[int, str, str]]:
    """Offset, type and name of each field of a payload, from the table in the section of that message."""
    rows = re.findall(r"^\| (\d+) \| ([\w\[\], ×]+) \| `?(\w+)`?", sections()[name], re.MULTILINE)
    return [(int(offset), kind, field) for offset, kind, field in rows]


def packed(name: str, values: dict[str, int | list[list[int]]], bits: int) -> bytes:
    """A payload put together from the page's tables."""
    out = b""
    for offset, kind, field in [*fields("Header"), *fields(name)]:
        assert offset == len(out), f"{name}: {field} is at {len(out)}, the page says {offset}"
        value = values[field]
        if kind.startswith("counts"):
            flat = [count for row in value for count in (row if isinstance(row, list) else [row])]
            out += struct.pack(f"<{len(flat)}{'h' if bits == 16 else 'i'}", *flat)
        elif kind.startswith("f32"):
            out += struct.pack(f"<{sum(map(len, value))}f", *(one for row in value for one in row))
        elif kind == "bytes":
            out += bytes.fromhex(value)
        elif kind == "u8[3]":
            out += bytes([value] * 3)
        else:
            out += struct.pack("<" + FORMATS[kind], value)
    return out + bytes.fromhex(values.get("rows", ""))  # which stand behind a number of readings


def vectors() -> list[dict]:
    """The known answers of the page."""
    (block,) = (block for block in blocks(PAGE) if block.language == "json" and '"line"' in block.text)
    return json.loads(block.text)
