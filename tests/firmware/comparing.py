"""What a device has sent, by kind, and all that is not the same between the emulator's and the firmware's."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.wire.loop_payloads import Malformed
from rig.wire.messages import DeviceFlag
from rig.wire.serial.frames import frame, payload_of
from tests.firmware.events import SERIAL, Choice, Event, Kind
from tests.firmware.python_device import PythonDevice
from tests.firmware.rows import Rows, SamplesOnBus, rows_of_payload
from tests.firmware.structure import readings

COMPARED_COUNTERS = {
    "watchdog_trips": 0,
    "emergency_stops": 1,
    "held_blocks": 2,
    "bad_outputs": 5,
    "outputs_while_idle": 7,
    "repeated_requests": 8,
    "repeated_frames": 14,
    "incomplete_blocks": 15,
    "resynchronised": 16,
    "continued_blocks": 17,
}
"""Counters that both have, and their place in ``struct vl_counters``."""


class Difference(NamedTuple):
    """What the two say."""

    what: str
    number: int
    python: object
    firmware: object

    def __str__(self) -> str:
        return f"{self.what} {self.number}: emulator {self.python}, firmware {self.firmware}"


class Said(NamedTuple):
    """What a device has sent, by kind; each with its time."""

    answers: list[tuple[int, bytes]]
    heartbeats: list[tuple[int, bytes]]
    rows: list[Rows]
    counters: tuple[int, ...]


def sort_out(choice: Choice, sent: Sequence[Event], block_of: Sequence[int]) -> Said:
    """What was sent, by kind; blocks have the sizes ``block_of``, in order."""
    counters = tuple(
        int(word) for event in sent if event.kind == Kind.COUNTERS for word in np.frombuffer(event.data, "<u4")
    )
    if choice.wire == SERIAL:
        answers, heartbeats, rows = _of_the_line(choice, sent)
    else:
        answers, heartbeats, rows = _of_the_bus(choice, sent, block_of)
    return Said(answers, heartbeats, rows, counters)


def _of_the_line(choice: Choice, sent: Sequence[Event]) -> tuple[list, list, list]:
    by_type: dict[int, list] = {2: [], 5: []}
    rows: list[Rows] = []
    rest = readback = b""
    for event in sent:
        if event.kind != Kind.BYTES:
            continue
        *frames, rest = (rest + event.data).split(b"\0")
        for one in frames:
            if one:
                payload = payload_of(one)
                assert frame(payload) == one + b"\0", "COBS in another form"
                assert not readback or payload[1] == 3, "a readback without its samples"
                if payload[1] == 7:
                    readback = payload
                elif payload[1] == 3:
                    rows.append(rows_of_payload(event.time_us, payload, choice, readback))
                    readback = b""
                else:
                    by_type[payload[1]].append((event.time_us, payload))
    assert not rest, "a frame without its end"
    return by_type[2], by_type[5], rows


def _of_the_bus(choice: Choice, sent: Sequence[Event], block_of: Sequence[int]) -> tuple[list, list, list]:
    answers, heartbeats = [], []
    samples = SamplesOnBus(choice, block_of)
    for event in sent:
        if event.kind != Kind.FRAME:
            continue
        function = int.from_bytes(event.data[:2], "little") & ~0xF
        if function == 0x030:
            answers.append((event.time_us, event.data))
        elif function == 0x010:
            heartbeats.append((event.time_us, event.data))
        elif function == 0x060:
            samples.take_readback(event)
        else:
            samples.take(event)
    return answers, heartbeats, samples.rows


def differences(python: PythonDevice, firmware_sent: Sequence[Event]) -> list[Difference]:
    """All that is not the same."""
    sizes = [block.size for block in python.plant.blocks]
    ours = sort_out(python.choice, python.link.sent, sizes)
    try:
        theirs = sort_out(python.choice, firmware_sent, sizes)
    except (AssertionError, Malformed) as error:
        return [Difference("what the firmware says is not a message", 0, "", repr(error))]
    out = [
        *_differences_of("answer", ours.answers, theirs.answers),
        *_differences_of("heartbeat", ours.heartbeats, theirs.heartbeats),
        *_differences_of_rows(python, ours.rows, theirs.rows),
    ]
    if not python.was_reset:
        both = python.device.counts + Counter(python.link.counters)
        for name, place in COMPARED_COUNTERS.items():
            if both[name] != theirs.counters[place]:
                out.append(Difference(f"counter {name}", 0, both[name], theirs.counters[place]))
    return out


def _differences_of(what: str, ours: list[tuple[int, bytes]], theirs: list[tuple[int, bytes]]) -> list[Difference]:
    out = [
        Difference(what, number, f"{one[0]} {one[1].hex(' ')}", f"{other[0]} {other[1].hex(' ')}")
        for number, (one, other) in enumerate(zip(ours, theirs, strict=False))
        if one[1] != other[1] or abs(one[0] - other[0]) > 1
    ]
    if len(ours) != len(theirs):
        out.append(Difference(f"number of {what}s", min(len(ours), len(theirs)), len(ours), len(theirs)))
    return out


def _differences_of_rows(python: PythonDevice, ours: list[Rows], theirs: list[Rows]) -> list[Difference]:
    out: list[Difference] = []
    choice, plant, link = python.choice, python.plant, python.link
    ramp_from = 0.0
    for number, (one, other) in enumerate(zip(ours, theirs, strict=False)):
        put_out, first, flags = plant.blocks[number], plant.firsts[number], link.flags[number]
        if not one.is_like(other):
            out.append(Difference("block", number, one, other))
        if other.counts.shape != one.counts.shape:
            out.append(Difference("block's shape", number, one.counts.shape, other.counts.shape))
            continue
        count = other.counts[:, 0].astype(np.int64)
        if not np.array_equal(readings(count, first, choice.n_channels, choice.bits), other.counts):
            out.append(Difference("structure", number, one.counts.tolist(), other.counts.tolist()))
        if (one.readback is None) != (other.readback is None):
            out.append(Difference("whether it reads back block", number, one.readback, other.readback))
        out += [
            Difference(f"readback of the {name}", number, rows.readback.tolist(), rows.counts[:, 0].tolist())
            for name, rows in (("emulator", one), ("firmware", other))
            if rows.readback is not None and not np.array_equal(rows.readback, rows.counts[:, 0])
        ]
        allowed = _allowed(put_out, flags, ramp_from, link.ramps_us[number])
        ramp_from = max(float(np.abs(put_out).max()), ramp_from * bool(flags & DeviceFlag.WATCHDOG))
        wrong = np.abs(count - put_out) > allowed
        if wrong.any():
            at = int(np.flatnonzero(wrong)[0])
            out.append(Difference("output", first + at, put_out[at : at + 5].tolist(), count[at : at + 5].tolist()))
    if len(ours) != len(theirs):
        out.append(Difference("number of blocks", min(len(ours), len(theirs)), len(ours), len(theirs)))
    return out


def _allowed(put_out: np.ndarray, flags: int, ramp_from: float, ramp_us: int) -> np.ndarray:
    """By how much the outputs [n] may differ: under a ramp by a count, and by what it falls in two microseconds."""
    if not flags & DeviceFlag.WATCHDOG or ramp_us == 0:
        return np.zeros(put_out.size)
    is_ramp = (put_out != np.rint(put_out)) | (np.abs(put_out) < ramp_from)
    return np.where(is_ramp, 1.0 + 2.0 * max(ramp_from, float(np.abs(put_out).max())) / ramp_us, 0.0)
