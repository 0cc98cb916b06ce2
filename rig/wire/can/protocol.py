"""The protocol on CAN for any number of channels: identifiers, frames of a row, the DBC file, and what an identifier means.

An identifier of 11 bits is 16 times a function plus the node (0 to 15). The lower it is, the sooner a frame wins the bus:

    0x000        EmergencyStop (of all nodes: not shifted)
    0x010        Heartbeat
    0x020, 0x030 Request, Answer
    0x040        OutputIndex
    0x050, 0x060 OutputPeriod, Readback (from version 2 on)
    0x070-0x090  records, state and rows of a loop on the device (CAN FD; no part of the DBC file: bytes without signals)
    0x100-0x2F0  Output (classical: 32 messages of one layout, the sequence is in the identifier)
    0x300-0x6F0  Samples (classical: up to 64 such messages; of each sequence one per part where a row needs several frames)
"""

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from pathlib import Path
from struct import Struct

from rig.errors import ConfigurationError, DaqRefused
from rig.wire.can.frames import padded_length
from rig.wire.can.layout import Layout, compile_layout, compile_text
from rig.wire.can.readbacks import COUNTS_A_FRAME
from rig.wire.messages import LOWEST_VERSION, VERSION

HIGHEST_NODE = 15  # four bits of an identifier
NODE_MASK = 0x00F  # bits of an identifier that are the node
CLASSICAL_OUTPUTS = 32  # sequence numbers of outputs, in the identifier: 5 bits
FD_WRAP = 256  # sequence numbers of CAN FD: one byte
CLASSICAL_SAMPLES = 64  # identifiers of samples: 6 bits
FD_PARTS = 8  # frames of a row, at most; chosen
CLASSICAL_PARTS = 4  # frames of a row, at most; chosen: 16 sequence numbers are left
CHANNELS_A_FRAME = OUTPUTS_A_FRAME = {True: 31, False: 4}  # int16 in a frame, of CAN FD (64 bytes) or classical (8)
HEADER = {True: 2, False: 0}  # bytes: sequence and flags, of CAN FD or classical
FD_ROWS = 31  # int16 in a frame of 64 bytes behind the header


@dataclass(frozen=True)
class Shape:
    """How rows of samples are spread over frames.

    A group is what one sequence number counts: ``rows`` rows of all channels, in ``parts`` frames.
    """

    n_channels: int
    fd: bool
    parts: int
    """Frames of a group, each with up to ``channels`` channels."""
    channels: int
    """Channels of a frame; the last part may have fewer."""
    rows: int
    """Rows of a group; the last group of a block may have fewer."""
    wrap: int
    """Sequence numbers of samples, 0 to wrap - 1."""

    @property
    def header(self) -> int:
        """Bytes before the first count: sequence and flags over CAN FD."""
        return HEADER[self.fd]

    @property
    def output_rows(self) -> int:
        """Outputs of a frame; the last frame of a block may have fewer."""
        return OUTPUTS_A_FRAME[self.fd]

    @property
    def output_wrap(self) -> int:
        """Sequence numbers of outputs."""
        return FD_WRAP if self.fd else CLASSICAL_OUTPUTS

    @property
    def largest_block(self) -> int:
        """Largest block: half of the sequence numbers, so that a missing frame can be told from a repeated one."""
        return min(self.wrap // 2 * self.rows, self.output_wrap // 2 * self.output_rows)

    def columns(self, part: int) -> slice:
        """Channels of a part."""
        return slice(part * self.channels, min((part + 1) * self.channels, self.n_channels))


def shape_of(n_channels: int, fd: bool) -> Shape:
    """How rows of ``n_channels`` are spread over frames; `DaqRefused` for too many channels."""
    largest = CHANNELS_A_FRAME[fd] * (FD_PARTS if fd else CLASSICAL_PARTS)
    if not 1 <= n_channels <= largest:
        bus = "CAN FD" if fd else "classical CAN"
        raise DaqRefused(f"{n_channels} channels: allowed over {bus} is 1 to {largest}")
    parts = -(-n_channels // CHANNELS_A_FRAME[fd])
    channels = -(-n_channels // parts)
    rows = FD_ROWS // n_channels if fd and parts == 1 else 1
    return Shape(n_channels, fd, parts, channels, rows, FD_WRAP if fd else CLASSICAL_SAMPLES // parts)


def definition(n_channels: int, fd: bool, version: int = VERSION) -> str:
    """The DBC file of a version of the protocol for so many channels, as text, for node 0.

    It is written here because the output of cantools changes with its version; the tests read it with cantools.
    """
    shape = shape_of(n_channels, fd)
    messages = [
        _message(0x000, "EmergencyStop", "Host", _unsigned(reason=8), False),
        _message(0x010, "Heartbeat", "Device", _unsigned(state=8, flags=8, boot=8, dropped=8, samples=32), False),
        _message(0x020, "Request", "Host", _unsigned(number=8, command=8, parameter=8, item=8, value=32), False),
        _message(0x030, "Answer", "Device", _unsigned(number=8, status=8, parameter=8, item=8, value=32), False),
        _message(0x040, "OutputIndex", "Host", _unsigned(first=32), False),
    ]
    outputs = [(f"sample_{row}", 16, True) for row in range(shape.output_rows)]
    if version > LOWEST_VERSION:
        messages.append(_message(0x050, "OutputPeriod", "Host", _unsigned(period=32, ramp=32), False))
        counts = [(f"sample_{row}", 16, True) for row in range(COUNTS_A_FRAME[fd])]
        messages.append(_message(0x060, "Readback", "Device", _unsigned(index=16) + counts, fd))
    if fd:
        messages.append(_message(0x100, "Output", "Host", _unsigned(sequence=8, reserved=8) + outputs, True))
    for index in range(0 if fd else CLASSICAL_OUTPUTS):
        messages.append(_message(0x100 + 16 * index, f"Output_{index:02d}", "Host", outputs, False))
    head = _unsigned(sequence=8, flags=8) if fd else []
    for index in range(shape.parts if fd else shape.wrap * shape.parts):
        columns = range(n_channels)[shape.columns(index % shape.parts)]
        names = (f"channel_{channel}" + f"_sample_{row}" * fd for row in range(shape.rows) for channel in columns)
        signals = head + [(name, 16, True) for name in names]
        messages.append(_message(0x300 + 16 * index, f"Samples_{index:02d}", "Device", signals, fd))
    return (
        _HEAD.format(version)
        + "\n".join(text for text, _ in messages)
        + _FORMATS
        + "".join(note for _, note in messages)
    )


_HEAD = 'VERSION "{}"\n\nNS_ :\n\nBS_:\n\nBU_: Host Device\n\n'
_FD_FORMAT = 14  # place of StandardCAN_FD in the list of formats below
_FORMATS = (
    '\nBA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG",'
    + '"reserved",' * 10
    + '"StandardCAN_FD","ExtendedCAN_FD";\nBA_DEF_DEF_ "VFrameFormat" "StandardCAN";\n'
)  # attribute of a DBC file that marks frames of CAN FD


def _unsigned(**bits: int) -> list[tuple[str, int, bool]]:
    return [(name, length, False) for name, length in bits.items()]


def _message(frame_id: int, name: str, sender: str, signals: list[tuple[str, int, bool]], fd: bool) -> tuple[str, str]:
    """A message with its signals one behind the other, and the note that it is of CAN FD."""
    receiver = "Device" if sender == "Host" else "Host"
    lines, end = [], 0
    for signal, bits, signed in signals:
        lines.append(f' SG_ {signal} : {end}|{bits}@1{"-" if signed else "+"} (1,0) [0|0] "" {receiver}\n')
        end += bits
    length = padded_length(end // 8) if fd else end // 8
    note = f'BA_ "VFrameFormat" BO_ {frame_id} {_FD_FORMAT};\n' if fd else ""
    return f"BO_ {frame_id} {name}: {length} {sender}\n{''.join(lines)}", note


class FrameKind(Enum):
    """Kinds of messages on a bus; over classical CAN, outputs and samples are many messages of one layout."""

    EMERGENCY_STOP = "EmergencyStop"
    HEARTBEAT = "Heartbeat"
    REQUEST = "Request"
    ANSWER = "Answer"
    OUTPUT_INDEX = "OutputIndex"
    OUTPUT_PERIOD = "OutputPeriod"
    READBACK = "Readback"
    OUTPUT = "Output"
    SAMPLES = "Samples"
    OF_LOOP = "a loop on the device"


LOOP_IDENTIFIERS = (0x070, 0x080, 0x090)
"""Records, states and rows of a loop on the device."""
SINCE_VERSION_2 = (FrameKind.OUTPUT_PERIOD.value, FrameKind.READBACK.value)


@dataclass(frozen=True)
class Protocol:
    """The definition for one node, in one version of the protocol: shape, layout and identifiers."""

    shape: Shape
    layout: Layout
    node: int

    @cached_property
    def kinds(self) -> dict[int, tuple[FrameKind, int]]:
        """Kind and number within the kind (sequence and part), by identifier."""
        out: dict[int, tuple[FrameKind, int]] = {}
        for name, message in self.layout.messages.items():
            base, _, number = name.partition("_")
            kind = FrameKind(base)
            node = 0 if kind is FrameKind.EMERGENCY_STOP else self.node
            out[message.frame_id + node] = (kind, int(number or 0))
        if self.carries_rows:
            out |= {base + self.node: (FrameKind.OF_LOOP, number) for number, base in enumerate(LOOP_IDENTIFIERS)}
        return out

    @property
    def carries_rows(self) -> bool:
        """Whether there are frames for a loop on the device: over CAN FD, unless a file gives their identifiers to others."""
        taken = {message.frame_id for message in self.layout.messages.values()}
        return self.shape.fd and self.version > LOWEST_VERSION and taken.isdisjoint(LOOP_IDENTIFIERS)

    @cached_property
    def identifiers(self) -> dict[tuple[FrameKind, int], int]:
        """The identifier of a kind and number."""
        return {meaning: identifier for identifier, meaning in self.kinds.items()}

    @property
    def version(self) -> int:
        """The version that it defines."""
        return VERSION if SINCE_VERSION_2[0] in self.layout.messages else LOWEST_VERSION

    def speaking(self, version: int) -> "Protocol":
        """The same definition in a version up to its own."""
        if version == self.version:
            return self
        messages = self.layout.messages.items()
        return replace(self, layout=Layout({name: one for name, one in messages if name not in SINCE_VERSION_2}))

    def packing(self, kind: FrameKind) -> Struct:
        """Packs the signals of a message without numbers."""
        return Struct(self.layout.messages[kind.value].format)


def protocol(n_channels: int, fd: bool, node: int, dbc: str | Path | None = None) -> Protocol:
    """The latest version of the protocol for so many channels, by the shipped definition or that of a file.

    A file may choose other identifiers, and nothing else: `ConfigurationError` names the message and what differs. One
    without the messages of version 2 defines version 1.
    """
    ConfigurationError.unless_between("driver.options.node", node, 0, HIGHEST_NODE)
    shape = shape_of(n_channels, fd)
    ours = compile_text(definition(n_channels, fd))
    if dbc is None:
        return Protocol(shape, ours, node)
    theirs = compile_layout(dbc)
    if not any(name in theirs.messages for name in SINCE_VERSION_2):
        ours = Protocol(shape, ours, node).speaking(LOWEST_VERSION).layout
    for name, message in ours.messages.items():
        ConfigurationError.raise_if(name not in theirs.messages, f"message {name} is missing", where=dbc)
        other = theirs.messages[name]
        wanted, found = message.canonical.split(" ", 1)[1], other.canonical.split(" ", 1)[1]
        if wanted != found:
            raise ConfigurationError(
                f"message {name}: is [{_short(found, wanted)}], expected [{_short(wanted, found)}]", where=dbc
            )
        if other.frame_id & NODE_MASK:
            raise ConfigurationError(
                f"message {name}: has the identifier 0x{other.frame_id:03X}",
                where=dbc,
                allowed="multiples of 16, for nodes",
            )
    return Protocol(shape, Layout({name: theirs.messages[name] for name in ours.messages}), node)


def _short(one: str, other: str) -> str:
    return " ".join(word for word in one.split() if word not in other.split()) or "in another order"
