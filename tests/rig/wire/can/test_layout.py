"""Compiled layouts against cantools, on the shipped definitions and on files of others."""

import struct
import subprocess
import sys
from pathlib import Path

import cantools
import numpy as np
import pytest

import rig.wire.can
from rig.errors import ConfigurationError, DaqRefused
from rig.wire.can.layout import compile_layout, compile_text
from rig.wire.can.protocol import definition, protocol, shape_of
from tests.refused import refused

FOLDER = Path(rig.wire.can.__file__).parent
SHIPPED = {
    (fd, version): FOLDER / f"vibrolock-4-{'fd' if fd else 'classical'}{'-v2' if version == 2 else ''}.dbc"
    for fd in (True, False)
    for version in (1, 2)
}

FOREIGN = """VERSION ""

BU_: A B

BO_ 291 Mixed: 24 A
 SG_ small : 0|8@1- (0.5,-3) [0|0] "degC" B
 SG_ motorola : 15|16@0- (0.25,0) [0|0] "" B
 SG_ long : 32|32@1+ (1,0) [0|0] "" B
 SG_ huge : 64|64@1- (1,0) [0|0] "" B
 SG_ real : 128|32@1- (1,0) [0|0] "V" B

SIG_VALTYPE_ 291 real : 1;
"""


def message(signal: str) -> str:
    return f'VERSION ""\n\nBU_: A B\n\nBO_ 7 M: 8 A\n SG_ {signal} (1,0) [0|0] "" B\n'


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("fd", [True, False])
def test_the_shipped_files_are_what_the_generator_writes_for_four_channels(fd: bool, version: int) -> None:
    assert SHIPPED[fd, version].read_text() == definition(4, fd, version)


@pytest.mark.parametrize(("n_channels", "fd"), [(4, True), (4, False), (7, False), (100, True)])
def test_version_1_is_version_2_without_periods_and_readbacks(n_channels: int, fd: bool) -> None:
    latest = protocol(n_channels, fd, 3)
    assert compile_text(definition(n_channels, fd, 1)).crc == latest.speaking(1).layout.crc
    assert latest.speaking(2).layout.crc == compile_text(definition(n_channels, fd, 2)).crc
    more = {latest.kinds[one][0].value for one in set(latest.kinds) - set(latest.speaking(1).kinds)}
    assert more == {"OutputPeriod", "Readback"} | ({"a loop on the device"} if fd else set())


@pytest.mark.parametrize(
    ("n_channels", "fd"), [(4, True), (4, False), (1, False), (7, False), (16, False), (31, True), (100, True)]
)
def test_random_frames_decode_to_the_values_of_cantools(n_channels: int, fd: bool) -> None:
    text = definition(n_channels, fd)
    ours, theirs = compile_text(text), cantools.database.load_string(text, "dbc")
    rng = np.random.default_rng(3)
    for wanted in theirs.messages:
        assert wanted.is_fd == ours.messages[wanted.name].fd
        data = rng.bytes(wanted.length)
        decoded = wanted.decode(data)
        message = ours.messages[wanted.name]
        assert {name: np.frombuffer(data, kind, 1, at)[0] for name, kind, at in message.placed} == decoded
        assert dict(zip(message.signals, struct.unpack(message.format, data), strict=True)) == decoded


def test_other_files_with_floats_and_big_endian_signals_decode_as_cantools_does() -> None:
    ours, theirs = compile_text(FOREIGN).messages["Mixed"], cantools.database.load_string(FOREIGN, "dbc")
    rng = np.random.default_rng(4)
    for _ in range(50):
        data = rng.bytes(16) + np.float32(rng.normal()).tobytes() + bytes(4)
        raw = theirs.decode_message("Mixed", data, scaling=False)
        assert {name: np.frombuffer(data, kind, 1, at)[0] for name, kind, at in ours.placed} == raw


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (message("x : 3|8@1+"), {"says": "message-m-signal-x-starts-at"}),
        (message("x : 0|12@1+"), {"says": "message-m-signal-x-has-bits"}),
        (
            message("x m0 : 0|8@1+").replace("SG_", 'SG_ s M : 8|8@1+ (1,0) [0|0] "" B\n SG_', 1),
            {"says": "message-m-is-multiplexed"},
        ),
        (
            message("x : 0|8@1+").replace("BO_ 7", f"BO_ {7 + (1 << 31)}"),
            {"says": "message-m-has-an-identifier-of", "allowed": "11", "where": "definition: message M"},
        ),
        ("nothing of the kind", {"says": "is-not-a-dbc-file"}),
    ],
)
def test_what_cannot_be_compiled_is_named(text: str, said: dict[str, object]) -> None:
    with refused(ConfigurationError, **said):
        compile_text(text)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with refused(ConfigurationError, "none-dbc"):
        compile_layout(tmp_path / "none.dbc")


def test_the_crc_sees_what_a_receiver_must_know_and_nothing_else() -> None:
    text = definition(4, True)
    crc = compile_text(text).crc
    head, *messages = text.partition("\nBA_DEF_")[0].split("BO_ ")
    shuffled = head + "".join(f"BO_ {part.strip()}\n\n" for part in reversed(messages)) + text[text.index("BA_DEF_") :]
    assert compile_text(shuffled).crc == crc
    assert compile_text(text.replace('""', '"count"', 50)).crc == crc
    assert compile_text(text + '\nCM_ BO_ 256 "words";\n').crc == crc
    for old, new in (("BO_ 256", "BO_ 272"), ("sequence", "number"), ("16|16@1-", "16|16@1+")):
        assert compile_text(text.replace(old, new)).crc != crc
    assert compile_text(text.replace('BA_ "VFrameFormat" BO_ 256 14;\n', "")).crc != crc


def test_a_definition_of_ones_own_may_move_identifiers_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "own.dbc"
    path.write_text(definition(4, True).replace("BO_ 64 OutputIndex", "BO_ 112 OutputIndex"))
    assert 0x73 in protocol(4, True, 3, path).kinds
    assert protocol(4, True, 3, path).version == 2
    path.write_text(definition(4, True, 1).replace("BO_ 64 OutputIndex", "BO_ 80 OutputIndex"))
    assert protocol(4, True, 3, path).version == 1
    for old, new, said in (
        ("BO_ 80 OutputPeriod", "BO_ 80 Other", {"says": "message-outputperiod-is-missing"}),
        (
            "BO_ 64 OutputIndex",
            "BO_ 65 OutputIndex",
            {"says": "message-outputindex-multiples-of", "allowed": "multiples of 16, for nodes"},
        ),
        ("sample_3 :", "sample_x :", {"says": "message-readback-is-sample-x"}),
        ("BO_ 64 OutputIndex", "BO_ 64 Other", {"says": "message-outputindex-is-missing"}),
    ):
        path.write_text(definition(4, True).replace(old, new))
        with refused(ConfigurationError, **said):
            protocol(4, True, 3, path)


def test_channels_that_fit_no_frames_are_refused() -> None:
    for n_channels, fd in ((0, True), (249, True), (17, False)):
        with refused(DaqRefused, reason=lambda text, n=n_channels: text.startswith(f"{n} channels: allowed over")):
            shape_of(n_channels, fd)


def test_identifiers_have_eleven_bits_and_are_those_of_one_node_only() -> None:
    for fd in (True, False):
        seen = [identifier for node in range(16) for identifier in protocol(4, fd, node).kinds if identifier]
        assert len(seen) == len(set(seen))
        assert max(seen) < 0x700


def test_the_package_is_imported_without_cantools_or_python_can_until_a_definition_is_compiled() -> None:
    command = "import sys, rig.drivers, rig.wire.messages; print('cantools' in sys.modules, 'can' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False", "False"]
