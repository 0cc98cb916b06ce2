"""One end of a wire, as host and device see it: whole messages in and out, whatever carries them."""

from abc import ABC, abstractmethod
from typing import NamedTuple

from rig.wire.messages import Message, Stream

__all__ = ["Link", "Load"]


class Load(NamedTuple):
    """What a stream asks of a wire and what the wire carries."""

    needed_bit_s: float
    """Bits per second, with framing, checksums and worst-case stuffing, both directions where they share the wire."""
    available_bit_s: float
    """Bits per second of the wire; infinite for a wire that does not exist (a pseudo-terminal)."""
    sum_text: str
    """The sum written out, for the message that refuses it."""

    @property
    def share(self) -> float:
        """Needed over available."""
        return self.needed_bit_s / self.available_bit_s


class Link(ABC):
    """One end of a wire.

    `receive` is called in a loop and must be cheap: it returns the next whole message, or None when none came within the
    time. Damaged, foreign or impossible frames never leave the link: they are counted and skipped, and memory stays bounded
    whatever comes in. Stream frames are only understood after `configure`.

    Errors: `DaqDisconnected` once the other end or the port is gone, `DaqBusy` for a port that somebody else holds.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.counters: dict[str, int] = {}
        """What went wrong so far, by name; whole numbers that only grow."""

    @abstractmethod
    def open(self) -> None:
        """Open the port; nothing is sent."""

    @abstractmethod
    def configure(self, stream: Stream) -> None:
        """Agree on the shape of samples and outputs; called at both ends before START takes effect."""

    @abstractmethod
    def send(self, message: Message) -> None:
        """Send one message, whole or not at all."""

    @abstractmethod
    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message; wait for it at most so long, 0 does not wait."""

    @abstractmethod
    def load(self, stream: Stream) -> Load:
        """What a stream would ask of this wire."""

    @property
    def largest_block(self) -> int:
        """Samples that a block may have on this wire."""
        return 1 << 16

    @property
    def layout_crc(self) -> int:
        """CRC-32 of the definition both ends must share; 0 where the protocol's page says it all."""
        return 0

    @abstractmethod
    def close(self) -> None:
        """Let go of the port; any time, any number of times, whatever has happened to it."""
