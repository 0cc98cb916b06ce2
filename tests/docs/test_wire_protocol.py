"""A device can be made from the page on the wire protocol alone: its tables, sums and known answers are the product's."""

import re
import struct

import numpy as np
import pytest

from rig import errors
from rig.bench import DriverChoice
from rig.drivers.serial import SerialDAQ
from rig.drivers.wire.connection import Connection
from rig.wire.loop_payloads import LARGEST_PAYLOAD
from rig.wire.messages import (
    ARM_KEY,
    ROW_BYTES,
    VERSION,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Output,
    Parameter,
    Readback,
    Record,
    Request,
    Rows,
    Samples,
    State,
    Status,
    Stream,
)
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from rig.wire.serial.link import line_load
from tests.docs import wire
from tests.docs.pages import table_under
from tests.rig.rigs import bench_with
from tests.rig.wire.serial.strategies import same

KINDS = {
    "Request": Request,
    "Answer": Answer,
    "Samples": Samples,
    "Output": Output,
    "Output of version 2": Output,
    "Readback": Readback,
    "Record": Record,
    "State": State,
    "Rows": Rows,
    "Heartbeat": Heartbeat,
    "Emergency stop": EmergencyStop,
}
TABLES = {
    "Commands": (Command, Status),
    "States": (DeviceState,),
    "Parameters": (Parameter,),
    "Flags": (DeviceFlag,),
}


def numbers(text):
    return {(int(number), name) for number, name in re.findall(r"^\| (\d+) \| ([A-Z_0-9]+) \|", text, re.MULTILINE)}


def test_what_goes_wrong_names_errors_and_counters_that_there_are():
    table = table_under("What goes wrong", wire.PAGE.read_text(encoding="utf-8"))["table"]
    words = set(re.findall(r"`(\w+)`", table)) - {one.name for one in Parameter}
    named = {word for word in words if word.startswith("Daq")}
    assert named == {name for name in errors.__all__ if name.startswith("Daq")} - {"DaqError", "DaqOverrun"}
    daq = SerialDAQ(bench_on_a_port())
    daq._connection = Connection(daq._make_link(), daq.clock)
    assert words - named == set(daq.counters) - {"overload", "output_clipped"}


def bench_on_a_port():
    driver = DriverChoice(name="serial", options={"port": "/dev/ttyACM0"})
    return bench_with().model_copy(update={"driver": driver})


def spaced(text):
    return bytes.fromhex(text.replace(" ", ""))


@pytest.mark.parametrize("section", TABLES)
def test_its_tables_name_every_number_and_no_other(section):
    ours = {(int(one), one.name) for table in TABLES[section] for one in table}
    assert numbers(wire.sections()[section]) == ours


def test_the_version_and_the_key_that_arms_are_those_in_force():
    page = wire.PAGE.read_text(encoding="utf-8")
    assert re.findall(r"Version of the protocol: \*\*(\d+)\*\*", page) == [str(VERSION)]
    assert f"0x{ARM_KEY:08X}" in wire.sections()["Commands"]
    assert re.findall(r"longer than (\d+) bytes", wire.sections()["Frames"]) == [str(LARGEST_PAYLOAD)]


def test_its_words_on_cobs_and_crc_hold_for_its_own_examples():
    text = wire.sections()["Frames"]
    examples = re.findall(r"`([0-9a-f ]+)` becomes `([0-9a-f ]+)`", text)
    assert len(examples) == 2
    for plain, encoded in examples:
        assert wire.cobs(spaced(plain)) == spaced(encoded)
        assert wire.uncobs(spaced(encoded)) == spaced(plain)
    assert f"`123456789` it is 0x{wire.crc32(b'123456789'):08X}" in text


def pieces_in(data):
    """The pieces of a state: array, 0, length, offset, and so many bytes."""
    while data:
        array, zero, length, offset = struct.unpack_from("<BBHI", data)
        assert zero == 0
        yield Record(array, offset, data[8 : 8 + length])
        data = data[8 + length :]


def message_of(vector):
    kind = KINDS[vector["message"]]
    values = {name: vector[name] for name in kind._fields if name in vector}
    if "counts" in values:
        values["counts"] = np.array(values["counts"], f"int{vector['bits']}")
    if "data" in values:
        values["data"] = bytes.fromhex(values["data"])
    if "readings" in values:
        values["readings"] = np.array(values["readings"], np.float32)
        values["rows"] = np.frombuffer(bytes.fromhex(values["rows"]), np.uint8).reshape(-1, ROW_BYTES)
    if kind is State:
        values["pieces"] = tuple(pieces_in(bytes.fromhex(vector["pieces"])))
    return kind(**values)


@pytest.mark.parametrize("number", range(18))
def test_known_answers_follow_from_its_tables_and_are_what_the_product_speaks(number):
    vectors = wire.vectors()
    assert len(vectors) == 18
    vector = vectors[number]
    payload, line = bytes.fromhex(vector["payload"]), bytes.fromhex(vector["line"])
    bits = vector.get("bits", 16)
    section = f"{vector['message']}, type {vector['type']}"
    assert wire.packed(section, vector, bits) == payload
    assert wire.on_the_line(payload) == line

    stream = Stream(2, 2, 1000.0, bits, loop=vector["message"] in ("Rows", "State"))
    codec, counters = Codec(), {}
    codec.version = vector["version"]
    codec.configure(stream)
    message = message_of(vector)
    assert frame(codec.encode(message)) == line
    (got,) = FrameReader(codec, counters).feed(line)
    assert same(got, message)
    assert not any(counters.values())


def test_a_line_is_loaded_as_its_table_says():
    rows = {
        name: [float(value.strip(" %")) for value in values.split("|")]
        for name, values in re.findall(r"^\| ([\w ,]+?) \| ([\d |%]+) \|$", wire.sections()["Load"], re.MULTILINE)
    }
    names = ("samples a block", "bytes a block", "bytes a readback", "line at 5 kHz", "highest rate, Hz")
    for block, size, readback, percent, highest_hz in zip(*(rows[name] for name in names), strict=True):
        for payload, n_bytes in ((28 + 2 * block * 4 + 4, size), (12 + 2 * block + 4, readback)):
            assert n_bytes == payload + payload // 254 + 2
        load = line_load(Stream(4, int(block), 5000.0), 3_000_000)
        assert load.needed_bit_s == pytest.approx(10 * (5000 / block * (size + readback / 20) + 10 * 23), rel=1e-12)
        assert round(100 * load.share) == percent
        at_most, beyond = (line_load(Stream(4, int(block), hz), 3_000_000).share for hz in (highest_hz, highest_hz + 1))
        assert at_most < 0.9 <= beyond
