"""The protocol's own messages in a compiled layout: which identifier is what."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from struct import Struct

from rig.errors import ConfigurationError
from rig.wire.can.definition import HIGHEST_NODE, NODE_MASK, Shape, definition, shape_of
from rig.wire.can.layout import Layout, compile_layout, compile_text

__all__ = ["FrameKind", "Protocol", "protocol"]


class FrameKind(Enum):
    """Messages that a bus carries; outputs and samples as many of one layout over classical CAN."""

    EMERGENCY_STOP = "EmergencyStop"
    HEARTBEAT = "Heartbeat"
    REQUEST = "Request"
    ANSWER = "Answer"
    OUTPUT_INDEX = "OutputIndex"
    OUTPUT = "Output"
    SAMPLES = "Samples"


@dataclass(frozen=True)
class Protocol:
    """The definition for one node: shape, layout and identifiers."""

    shape: Shape
    layout: Layout
    node: int

    @cached_property
    def kinds(self) -> dict[int, tuple[FrameKind, int]]:
        """What an identifier stands for: kind and number within its kind (sequence and part), by identifier."""
        out: dict[int, tuple[FrameKind, int]] = {}
        for name, message in self.layout.messages.items():
            base, _, number = name.partition("_")
            kind = FrameKind(base)
            out[self._shifted(kind, message.frame_id)] = (kind, int(number or 0))
        return out

    @cached_property
    def identifiers(self) -> dict[tuple[FrameKind, int], int]:
        """The identifier of a kind and number."""
        return {meaning: identifier for identifier, meaning in self.kinds.items()}

    def packing(self, kind: FrameKind) -> Struct:
        """Packs the signals of a message without numbers."""
        return Struct(self.layout.messages[kind.value].format)

    def _shifted(self, kind: FrameKind, frame_id: int) -> int:
        return frame_id if kind is FrameKind.EMERGENCY_STOP else frame_id + self.node


def protocol(n_channels: int, fd: bool, node: int, dbc: str | Path | None = None) -> Protocol:
    """The protocol for so many channels, by the shipped definition or that of a file.

    A file may choose other identifiers, and nothing else: `ConfigurationError` names the message and what differs.
    """
    if not 0 <= node <= HIGHEST_NODE:
        raise ConfigurationError(f"driver.options.node = {node}: allowed is 0 to {HIGHEST_NODE}")
    shape = shape_of(n_channels, fd)
    ours = compile_text(definition(n_channels, fd))
    if dbc is None:
        return Protocol(shape, ours, node)
    theirs = compile_layout(dbc)
    for name, message in ours.messages.items():
        if name not in theirs.messages:
            raise ConfigurationError(f"{dbc}: message {name} is missing")
        other = theirs.messages[name]
        wanted, found = message.canonical.split(" ", 1)[1], other.canonical.split(" ", 1)[1]
        if wanted != found:
            raise ConfigurationError(
                f"{dbc}: message {name}: is [{_short(found, wanted)}], wanted is [{_short(wanted, found)}]"
            )
        if other.frame_id & NODE_MASK:
            raise ConfigurationError(
                f"{dbc}: message {name}: has the identifier 0x{other.frame_id:03X}, allowed are multiples of 16, for nodes"
            )
    return Protocol(shape, Layout({name: theirs.messages[name] for name in ours.messages}), node)


def _short(one: str, other: str) -> str:
    """The words of one line that the other has not."""
    return " ".join(word for word in one.split() if word not in other.split()) or "in another order"
