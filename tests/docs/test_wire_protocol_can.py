"""What the page on CAN says: frames, loads, sums and blocks, against the codec."""

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame, frame_seconds
from rig.wire.can.layout import compile_text
from rig.wire.can.link import bus_load, traffic
from rig.wire.can.protocol import FrameKind, definition, protocol, shape_of
from rig.wire.messages import (
    Answer,
    EmergencyStop,
    Heartbeat,
    Output,
    Readback,
    Record,
    Request,
    Rows,
    Samples,
    State,
    Stream,
)
from tests.docs.pages import ROOT, blocks

PAGE = ROOT / "docs" / "reference" / "wire-protocol-can.md"
MESSAGES: dict[str, Any] = {
    kind.__name__: kind for kind in (Answer, EmergencyStop, Heartbeat, Output, Readback, Request, Samples)
}


def table(heading: str) -> list[list[str]]:
    """The rows of the table whose head begins with these words."""
    lines = iter(PAGE.read_text(encoding="utf-8").splitlines())
    next(line for line in lines if line.startswith(f"| {heading} |"))
    next(lines)
    out = []
    for line in lines:
        if not line.startswith("|"):
            break
        out.append([cell.strip() for cell in line.strip("|").split("|")])
    return out


def known_answers(version: int) -> list[tuple[str, str, list[Frame]]]:
    out: list[tuple[str, str, list[Frame]]] = []
    head = "bus" if version == 1 else f"bus of version {version}"
    for bus, message, identifier, data in table(f"{head} | message | identifier | data"):
        if bus:
            out.append((bus, message.strip("`"), []))
        large = out[-1][0] == "FD" and int(identifier, 16) >= 0x60
        out[-1][2].append(Frame(int(identifier, 16), bytes.fromhex(data), large))
    return out


def said(text: str) -> Any:
    message = eval(text, MESSAGES)
    return message._replace(counts=np.array(message.counts, np.int16)) if hasattr(message, "counts") else message


@pytest.mark.parametrize(
    ("bus", "version", "n"), [("classical", 1, 1), ("FD", 1, 2), ("classical", 2, 4), ("FD", 2, 2)]
)
def test_the_known_answers_are_sent_and_understood(bus: str, version: int, n: int) -> None:
    fd = bus == "FD"
    device, host = (CanCodec(protocol(4, fd, 1), end, {}) for end in (True, False))
    for end in (device, host):
        end.speak(version)
        end.configure(Stream(4, n, 1000.0))
    host._here = 65536 if version == 2 and not fd else 0
    rows = [(message, frames) for name, message, frames in known_answers(version) if name == bus]
    assert len(rows) == {("classical", 1): 9, ("FD", 1): 9, ("classical", 2): 5, ("FD", 2): 7}[bus, version]
    for text, frames in rows:
        message = said(text)
        sender, receiver = (host, device) if isinstance(message, Request | Output | EmergencyStop) else (device, host)
        assert sender.encode(message) == frames, text
        got = [one for frame in frames if (one := receiver.decode(frame)) is not None][-1]
        assert type(got) is type(message)
        if hasattr(message, "counts"):
            np.testing.assert_array_equal(got.counts, message.counts)
            assert got.first == message.first
            assert got[3:] == message[3:] or isinstance(got, Samples)
        else:
            assert got == message


def test_the_loads_are_those_that_the_driver_computes() -> None:
    rows = table("bus | rate, Hz | n | load, version 1 | load, version 2")
    assert len(rows) >= 20
    for bus, rate_hz, n, *loads in rows:
        fd = "/" in bus.removesuffix(" Mbit/s")
        data_bit_rate_hz = 1e6 * float(bus.removesuffix(" Mbit/s").split("/")[-1]) if fd else 0.0
        for version, load in zip((1, 2), loads, strict=True):
            found = bus_load(shape_of(4, fd), Stream(4, int(n), float(rate_hz)), 1e6, data_bit_rate_hz, version)
            assert f"{found.share:.0%}" == load


def test_the_loads_of_a_loop_on_the_device_are_those_that_the_driver_computes() -> None:
    rows = table("bus of the loop | rate, Hz | channels")
    assert len(rows) == 7
    for bus, rate_hz, n_channels, *loads in rows:
        rates = 1e6, 1e6 * float(bus.removesuffix(" Mbit/s").split("/")[1])
        stream = Stream(int(n_channels), int(rate_hz) // 50, float(rate_hz), loop=True, state_blocks=5)
        parts = [part.share for part in traffic(shape_of(stream.n_channels, True), stream, *rates)]
        assert [f"{share:.0%}" for share in (*parts[:2], sum(parts))] == loads


def test_the_known_answers_of_a_loop_on_the_device_are_sent_and_understood() -> None:
    device, host = (CanCodec(protocol(2, True, 1), end, {}) for end in (True, False))
    for end in (device, host):
        end.speak(2)
        end.configure(Stream(2, 1, 1000.0, loop=True))
    said_and_sent: list[tuple[str, list[Frame]]] = []
    for text, identifier, data in table("message of the loop | identifier | data"):
        if text:
            said_and_sent.append((text.strip("`"), []))
        said_and_sent[-1][1].append(Frame(int(identifier, 16), bytes.fromhex(data), True))
    assert [text.split("(")[0] for text, _ in said_and_sent] == ["Record", "State", "Rows", "State"]
    for text, frames in said_and_sent:
        message = eval(text, {kind.__name__: kind for kind in (Record, State, Rows)})
        if isinstance(message, Rows):
            message = message._replace(
                readings=np.array(message.readings, np.float32), rows=np.array(message.rows, np.uint8)
            )
        sender, receiver = (host, device) if isinstance(message, Record) else (device, host)
        assert sender.encode(message) == frames, text
        (got,) = [one for frame in frames if (one := receiver.decode(frame)) is not None]
        assert repr(got) == repr(message)


def test_the_formulas_for_frames_are_those_in_use() -> None:
    for k in range(9):
        assert frame_seconds(k, False, 1.0) == 47 + 8 * k + (33 + 8 * k) // 4
    for k in (8, 12, 16, 20, 64):
        fast = 5 + 8 * k + (5 + 8 * k) // 4 + (27 if k <= 16 else 32)
        assert frame_seconds(k, True, 1.0, 1.0) == 34 + fast


def test_the_crc_is_that_of_the_lines_which_the_page_describes() -> None:
    for name, crc in table("definition | CRC-32"):
        found = re.fullmatch(r"(\d+) channels, (CAN FD|classical), version (\d)", name)
        assert found is not None
        layout = compile_text(definition(int(found[1]), found[2] == "CAN FD", int(found[3])))
        lines = [one.canonical for one in sorted(layout.messages.values(), key=lambda one: one.frame_id)]
        assert f"{zlib.crc32(chr(10).join(lines).encode()):08x}" == crc == f"{layout.crc:08x}"
    shown = next(block for block in blocks(PAGE) if " EmergencyStop " in block.text).text.splitlines()
    assert lines[: len(shown)] == shown


def test_identifiers_lengths_and_largest_blocks_are_those_of_the_definition() -> None:
    for identifier, message, _, n_bytes, layout in table("identifier | message | from | bytes | layout, little-endian"):
        name = message.split(",")[0].removesuffix("_i")
        base = int(identifier[:5], 16)
        for fd in (True, False):
            one = protocol(4, fd, 5)
            assert one.identifiers[FrameKind(name), 0] == base + (5 if "node" in identifier else 0)
            if layout:
                known = one.layout.messages[name]
                assert tuple(re.findall(r"`(\w+)`", layout)) == known.signals
                assert n_bytes in (str(known.length), "0 to 8")
    for bus, largest, rows, outputs in table("bus, 4 channels | largest block"):
        shape = shape_of(4, bus == "CAN FD")
        assert (shape.largest_block, shape.rows, shape.output_rows) == (int(largest), int(rows), int(outputs))


def test_the_shipped_files_that_the_page_names_are_there() -> None:
    folder = Path(ROOT / "rig" / "wire" / "can")
    assert {path.name for path in folder.glob("*.dbc")} == {
        f"vibrolock-4-{bus}{version}.dbc" for bus in ("fd", "classical") for version in ("", "-v2")
    }
    assert all(path.name in PAGE.read_text(encoding="utf-8") for path in folder.glob("*.dbc"))
