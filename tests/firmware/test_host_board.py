"""The board host as a program: description, line, adapter and ends, without the process that usually runs it."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from rig.emulator.firmware import description
from rig.emulator.plant import VirtualPlant
from rig.emulator.settings import EmulatorSettings
from rig.wire.can.frames import Frame
from rig.wire.can.slcan_lines import SlcanLines, encode_line
from rig.wire.messages import Answer, Command, Parameter, Request
from rig.wire.parameter_words import double_words, float_word, text_words
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
from rig.wire.serial.port import open_pseudo_terminal
from tests.firmware.building import built
from tests.rig.rigs import bench_with
from tests.waiting import LONG_S, wait_until

REST = bytes(4)
NODE = 3


class Board:
    """The program with its pipes, and the far end of its line."""

    def __init__(self, text: str, *arguments: str, program: Path | None = None) -> None:
        self.line = open_pseudo_terminal()
        os.set_blocking(self.line.far_descriptor, False)
        self.requests, output = os.pipe()
        input_, self.answers = os.pipe()
        descriptors = {"--plant-in": input_, "--plant-out": output, "--line": self.line.descriptor}
        words = [word for name, one in descriptors.items() for word in (name, str(one))]
        self.child = subprocess.Popen(
            [program or built("host-sanitized"), *words, *arguments],
            pass_fds=(input_, output, self.line.descriptor),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for one in (input_, output):
            os.close(one)
        with suppress(BrokenPipeError):  # it has ended already
            os.write(self.answers, text.encode("ascii"))

    def began(self) -> "Board":
        """Answer its first request."""
        assert os.read(self.requests, 4) == REST
        os.write(self.answers, REST)
        return self

    def send(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self.line.far_descriptor, data) :]
            except BlockingIOError:
                time.sleep(0.001)

    def received(self) -> bytes:
        try:
            return os.read(self.line.far_descriptor, 1 << 16)
        except BlockingIOError:
            time.sleep(0.001)
            return b""

    def until(self, has_come: Callable[[bytes], bool]) -> bytes:
        """Read until it has come."""
        out = b""

        def come() -> bool:
            nonlocal out
            out += self.received()
            return has_come(out)

        wait_until(come, "an answer of the board")
        return out

    def ended(self) -> tuple[int, str, str]:
        """Status, standard output and standard error once it has ended."""
        said, complained = self.child.communicate(timeout=LONG_S)
        return self.child.returncode, said.decode(), complained.decode()

    def close(self) -> None:
        self.child.kill()
        self.child.communicate()
        self.line.close()
        for one in (self.requests, self.answers):
            os.close(one)


@contextmanager
def board(text: str | None = None, *arguments: str, **changes: Any) -> Iterator[Board]:
    """A board described by a virtual bench, or by a text."""
    one = Board(described(**changes) if text is None else text, *arguments)
    try:
        yield one
    finally:
        one.close()


@cache
def described(**changes: Any) -> str:
    given = EmulatorSettings(wire=changes.pop("wire", "serial"), bench=bench_with(), **changes)
    return description(given, VirtualPlant(given.bench))


def test_it_is_the_device_that_it_was_told_to_be() -> None:
    plant = VirtualPlant(bench_with())
    wanted = {
        (Parameter.SERIAL_NUMBER, 0): text_words("4711")[0],
        (Parameter.N_CHANNELS, 0): len(plant.names),
        (Parameter.CHANNEL_NAME, 8): text_words(plant.names[1])[0],
        (Parameter.CHANNEL_RANGE_V, 1): float_word(float(plant.range_v[1])),
        (Parameter.CHANNEL_V_PER_COUNT, 1): float_word(float(plant.v_per_count[1])),
        (Parameter.OUTPUT_RANGE_V, 0): float_word(plant.output_range_v),
        (Parameter.OUTPUT_V_PER_COUNT, 0): float_word(plant.output_v_per_count),
        (Parameter.HIGHEST_RATE_MHZ, 0): 5_000_000,
        (Parameter.FILTER_DELAY_S, 0): double_words(plant.filter_delay_s)[0],
        (Parameter.FILTER_DELAY_S, 1): double_words(plant.filter_delay_s)[1],
        (Parameter.SIMULATED, 0): 2,
    }
    with board(serial_number="4711", lockstep=True) as one:
        one.began()
        for number, ((parameter, item), value) in enumerate(wanted.items(), 1):
            (answer,) = asked(one, Request(number, Command.GET, parameter, item))
            assert (answer.number, answer.status) == (number, 0)
            assert answer.value == value, parameter


def asked(one: Board, request: Request) -> list[Answer]:
    """Answers to a request over the serial line, and those that have waited there."""
    one.send(b"\0" + frame(Codec().encode(request)))
    return answers_in(one.until(lambda data: request.number in [answer.number for answer in answers_in(data)]))


def answers_in(data: bytes) -> list[Answer]:
    return [message for message in FrameReader(Codec(), {}).feed(data) if isinstance(message, Answer)]


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ("bits 16", "bits many", "makes no sense: bits many"),
        ("boot ", "booty ", "makes no sense: booty"),
        ("node 1", "node 16", "makes no sense: node 16"),
        ("wire serial", "wire string", "makes no sense: wire string"),
        ("bits 16", "bits 4294967296", "makes no sense: bits 4294967296"),
        ("bits 16", "bits 17", "does not fit"),
        ("output 0x1.", "output 1.", "makes no sense: output 1."),
        ("output 0x1.", "output -0x1.", "makes no sense: output -0x1."),
        ("p+", "q+", "makes no sense"),
        ("channel ", "channel  ", "makes no sense: channel  "),
        ("serial_number 0001", "serial_number " + "1" * 33, "makes no sense"),
        ("serial_number 0001", "serial_number " + "1" * 200, "too long"),
        ("lockstep 0\n", "", "is missing: lockstep"),
        ("model", "end\nmodel", "is missing: model"),
    ],
)
def test_a_bad_description_is_one_line_and_status_2(was: str, becomes: str, said: str) -> None:
    text = described()
    assert was in text
    with board(text.replace(was, becomes)) as one:
        status, _, complained = one.ended()
    assert status == 2
    assert said in complained
    assert complained.count("\n") == 1


HOSTILE = (
    "end",
    "channel",
    "output",
    "boot",
    "wire can",
    "0x1p+0",
    "-0x1p-1100",
    "0x",
    "4294967295",
    " ",
    "\0",
    "9" * 40,
)


@given(st.integers(0, 18), st.lists(st.sampled_from(HOSTILE) | st.text("0123456789abcdefpx.+- ", max_size=40)))
@settings(max_examples=60)
def test_any_line_in_a_description_is_taken_or_refused(place: int, words: list[str]) -> None:
    lines = described().splitlines()
    lines[place] = " ".join(words)
    with board("\n".join(lines) + "\nend\n") as one:
        if os.read(one.requests, 4) != REST:
            status, _, complained = one.ended()
            assert status == 2
            assert complained.count("\n") == 1


def test_more_channels_than_its_memory_has_are_refused() -> None:
    row = next(line for line in described().splitlines() if line.startswith("channel"))
    with board(described().replace("end\n", f"{row}\n" * 31 + "end\n")) as one:
        assert one.ended()[0] == 2


def test_a_description_that_ends_early_and_bad_arguments_are_refused() -> None:
    with board("model one\n") as one:
        os.close(one.answers)
        one.answers = os.dup(one.requests)
        assert one.ended()[::2] == (
            2,
            "plant: the description ends, or a line of it is too long, before a line 'end'\n",
        )
    for arguments in (("--log-output",), ("--speed", "1"), ("--line", "first")):
        with board(None, *arguments) as one:
            status, _, complained = one.ended()
            assert (status, complained[:12]) == (2, "usage: host ")


def test_a_log_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with board(None, "--log-output", str(tmp_path / "no" / "log")) as one:
        assert one.ended()[::2] == (2, "--log-output: cannot be written: No such file or directory\n")


@given(st.floats(min_value=1e-30, max_value=3e38))
@settings(max_examples=20)
def test_floats_arrive_to_the_last_bit(value: float) -> None:
    text = "\n".join(
        f"output {value.hex()} {value.hex()}" if line.startswith("output") else line
        for line in described().splitlines()
    )
    with board(text + "\n") as one:
        one.began()
        (answer,) = asked(one, Request(1, Command.GET, Parameter.OUTPUT_RANGE_V))
        assert answer.value == float_word(value)


def test_told_to_end_it_says_what_it_has_counted() -> None:
    with board() as one:
        one.began()
        one.send(b"\0" + b"garbage\0" * 3)
        asked(one, Request(1, Command.GET, Parameter.PING))
        one.child.send_signal(signal.SIGTERM)
        status, said, complained = one.ended()
    counts = dict(line.split() for line in said.splitlines())
    assert (status, complained) == (0, "")
    assert counts["damaged_frames"] == "3"
    assert counts["watchdog_trips"] == "0"


@pytest.mark.parametrize("lockstep", [False, True])
@pytest.mark.parametrize("samples", [False, True])
def test_without_its_structure_it_ends_with_status_3_at_0_v(samples: bool, lockstep: bool, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with board(None, "--log-output", str(log), lockstep=lockstep) as one:
        one.began()
        if samples:
            one.send(b"\0" + frame(Codec().encode(Request(1, Command.START))))
            assert os.read(one.requests, 4) != REST  # it waits for a block, perhaps before it has answered
        os.close(one.answers)
        one.answers = os.dup(one.requests)
        status, _, complained = one.ended()
    assert (status, complained) == (3, "the virtual structure is gone\n")
    assert float(log.read_text().splitlines()[-1].split()[2]) == 0.0


def test_a_line_without_another_end_is_no_error() -> None:
    with board() as one:
        one.began()
        asked(one, Request(1, Command.GET, Parameter.PING))
        os.close(one.line.far_descriptor)
        time.sleep(0.1)
        assert one.child.poll() is None
        far = os.open(one.line.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        one.line = one.line._replace(far_descriptor=far)
        (answer,) = asked(one, Request(2, Command.GET, Parameter.PING))
        assert answer.number == 2


def test_nobody_reads_and_it_goes_on_and_answers_whoever_comes_then() -> None:
    with board(lockstep=True) as one:
        one.began()
        for number in range(1, 250):  # far more answers than a line holds
            one.send(b"\0" + frame(Codec().encode(Request(number, Command.GET, Parameter.MODEL))))
            one.send(b"\0" * 200)
        time.sleep(0.1)
        while one.received():
            pass
        (answer,) = asked(one, Request(251, Command.GET, Parameter.PING))[-1:]
        assert answer.number == 251


def is_answer(line: Frame) -> bool:
    return line.identifier == 0x30 + NODE


def frames_in(data: bytes) -> list[Frame]:
    lines = SlcanLines({})
    lines.feed(data)
    return list(lines.frames)


def ping(number: int) -> bytes:
    return encode_line(Frame(0x20 + NODE, bytes([number, Command.GET, Parameter.PING, 0, 0, 0, 0, 0])))


def test_its_adapter_obeys_commands_and_passes_frames_while_it_is_open() -> None:
    with board(wire="can", node=NODE) as one:
        one.began()
        one.send(ping(1) + b"V\rN\rF\rS8\rY5\r")  # not open: the request does not pass
        assert one.until(lambda data: data.endswith(b"\r\r")) == b"V1013\rN0001\rF00\r\r\r"
        one.send(b"O\r" + ping(2))
        seen = frames_in(one.until(lambda data: any(map(is_answer, frames_in(data)))))
        assert [frame.data[0] for frame in seen if is_answer(frame)] == [2]
        one.send(b"C\r" + ping(3) + b"V\r")
        assert one.until(lambda data: b"V1013\r" in data).endswith(b"\rV1013\r")
        time.sleep(0.25)
        assert not frames_in(one.received())  # no heartbeats either


@given(st.lists(st.binary(max_size=300), max_size=6))
@settings(max_examples=30)
def test_hostile_text_at_the_adapter_is_skipped(pieces: list[bytes]) -> None:
    with board(wire="can", node=NODE, fd=False) as one:
        one.began()
        one.send(b"O\r")
        for piece in pieces:
            one.send(piece)
        one.send(b"\rO\r" + ping(77))
        assert frames_in(one.until(lambda data: any(frame.data[:1] == b"M" for frame in frames_in(data))))
        one.child.send_signal(signal.SIGINT)
        assert one.ended()[0] == 0


@pytest.mark.parametrize(
    "line",
    [
        *(b"t0232", b"t", b"T000000230", b"T0000002F0", b"r0230", b"b02381122", b"d023F00", b"t8230", b"t023 0", b"x"),
        *(b"t02390011223344556677", b"t0231G0", b"b023F" + b"0" * 129, b"b023F" + b"0" * 300, b"S" * 16, b"\0"),
    ],
)
def test_what_is_no_frame_of_eleven_bits_reaches_nobody(line: bytes) -> None:
    with board(wire="can", node=NODE) as one:
        one.began()
        one.send(b"O\r" + line + b"\r" + ping(5))
        one.until(lambda data: any(map(is_answer, frames_in(data))))
        one.child.send_signal(signal.SIGTERM)
        counts = dict(text.split() for text in one.ended()[1].splitlines())
    skipped = int(counts["damaged_lines"]) + int(counts["other_frames"])
    assert skipped == 1
    assert counts["malformed"] == counts["damaged_frames"] == counts["foreign_frames"] == "0"
