"""`Link`: one end of a wire, for host or device. Whole messages go in and out, whatever carries them."""

from abc import ABC, abstractmethod
from typing import NamedTuple

from rig.wire.messages import LOWEST_VERSION, VERSION, Message, Stream

LATE_SHARE = 0.05
"""Share of the blocks that are counted as late in the load of a wire, each with its readback (version 2)."""


class Load(NamedTuple):
    """Bit rate that a stream needs and that the wire has."""

    needed_bit_s: float
    """Bits per second, with framing, checksums and worst-case stuffing, both directions where they share the wire."""
    available_bit_s: float
    """Bits per second of the wire; infinite for a wire that does not exist (a pseudo-terminal)."""
    sum_text: str
    """The sum written out, for the error if it is too much."""

    @property
    def share(self) -> float:
        """Needed over available."""
        return self.needed_bit_s / self.available_bit_s


class Link(ABC):
    """One end of a wire.

    `receive` is called in a loop and must be cheap: it returns the next whole message, or None if none came in time. Damaged,
    foreign or impossible frames are counted and skipped inside the link, and memory stays bounded whatever comes in. Samples
    and outputs are understood only after `configure`.

    Errors: `DaqDisconnected` once the other end or the port is gone, `DaqBusy` for a port that somebody else holds.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.version = LOWEST_VERSION
        """Version of the protocol in use."""
        self.counters: dict[str, int] = {}
        """Faults so far, by name; whole numbers that only grow."""

    @abstractmethod
    def open(self) -> None:
        """Open the port; nothing is sent."""

    def speak(self, version: int) -> None:
        """Use a version of the protocol from now on; it is agreed on before `configure`."""
        self.version = version

    @property
    def highest_version(self) -> int:
        """Latest version that this wire can carry."""
        return VERSION

    @abstractmethod
    def configure(self, stream: Stream) -> None:
        """Set channels and block size of samples and outputs; called at both ends before START takes effect."""

    @abstractmethod
    def send(self, message: Message) -> None:
        """Send one message, whole or not at all."""

    @abstractmethod
    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message, or None after ``timeout_s``; 0 does not wait."""

    @abstractmethod
    def load(self, stream: Stream) -> Load:
        """Load of this wire by a stream."""

    def why_no_rows(self, stream: Stream) -> str:
        """Why this wire cannot carry the rows of a loop on the device, whatever its speed; empty if it can."""
        del stream
        return ""

    @property
    def largest_block(self) -> int:
        """Largest number of samples in a block on this wire."""
        return 1 << 16

    def largest_block_of(self, n_channels: int, bits: int) -> int:
        """Largest number of samples in a block of so many channels and so many bits a count."""
        del n_channels, bits  # which the largest block of most wires does not depend on
        return self.largest_block

    @property
    def layout_crc(self) -> int:
        """CRC-32 of the definition that both ends must share, in the version in use; 0 if the wire has none."""
        return 0

    @abstractmethod
    def close(self) -> None:
        """Close the port; allowed at any time, any number of times, also after an error."""
