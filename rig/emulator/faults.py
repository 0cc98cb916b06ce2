"""Faults of a device, so that a host can be tested with it: messages lost, repeated, reordered or late, and false facts."""

import math
from collections import deque
from dataclasses import dataclass

from rig.errors import DaqError
from rig.wire.link import Link
from rig.wire.messages import Message, Readback, Samples


@dataclass(frozen=True)
class Faults:
    """Faults of a device; none by default. Blocks count from 1, and 0 in ``..._every`` means never."""

    version: int | None = None
    """The only version of the protocol that it speaks; one of version 1 goes on with nothing."""
    channel_names: tuple[str, ...] | None = None
    """Channel names that it reports instead of the true ones."""
    channels_sent: int | None = None
    """Number of channels that it sends, whatever it reports."""
    deaf_after_s: float | None = None
    """Time after START from which on it ignores all messages, but goes on sampling, s."""
    silent_after_s: float | None = None
    """Time after START from which on it sends nothing, s."""
    reset_after_s: float | None = None
    """Time after START at which it resets, s."""
    drop_every: int = 0
    """One of so many blocks is lost on the way."""
    drop_burst: int = 1
    """Number of blocks lost in a row."""
    repeat_every: int = 0
    """One of so many blocks arrives twice."""
    reorder_every: int = 0
    """One of so many blocks arrives after the next one."""
    late_every: int = 0
    """One of so many blocks, and all messages after it, arrive late."""
    late_s: float = 0.05
    """By how much they are late, s."""


Block = tuple[Samples] | tuple[Readback, Samples]
"""The messages of a block of samples."""


class FaultySender:
    """Sends over a link, with faults. Messages that the link refuses are dropped; lost samples are counted."""

    def __init__(self, link: Link, faults: Faults) -> None:
        self._link, self._faults = link, faults
        self.dropped_samples = 0
        self._kept: Block | tuple[()] = ()
        self._late: deque[tuple[float, Message]] = deque()
        self._silent_s = math.inf

    @property
    def wake_s(self) -> float:
        """When the next late message is due."""
        return self._late[0][0] if self._late else math.inf

    def start(self, now_s: float) -> None:
        """Begin a new stream."""
        self.dropped_samples = 0
        self._kept = ()
        self._late.clear()
        silent = self._faults.silent_after_s
        self._silent_s = now_s + silent if silent is not None else math.inf

    def send(self, message: Message, now_s: float) -> bool:
        """Send a message after those that are late; False if the link refused it."""
        if now_s >= self._silent_s:
            return False
        if self._late:
            self._late.append((self._late[-1][0], message))
            return True
        return self._send(message)

    def _send(self, message: Message) -> bool:
        try:
            self._link.send(message)
        except DaqError:
            if isinstance(message, Samples | Readback):
                self.dropped_samples += message.counts.shape[0]
            return False
        return True

    def flush(self, now_s: float) -> None:
        """Send the late messages that are due."""
        while self._late and self._late[0][0] <= now_s:
            self._send(self._late.popleft()[1])

    def send_block(self, block: Block, number: int, now_s: float) -> None:
        """Send block ``number``, counted from 1, with its faults."""
        faults = self._faults
        if faults.drop_every and number % faults.drop_every < faults.drop_burst and number >= faults.drop_every:
            return
        if faults.late_every and number % faults.late_every == 0:
            self._late.extend((now_s + faults.late_s, message) for message in block)
            return
        if faults.reorder_every and number % faults.reorder_every == 0:
            self._kept = block
            return
        self._send_whole(block, now_s)
        if self._kept:
            kept, self._kept = self._kept, ()
            self._send_whole(kept, now_s)
        if faults.repeat_every and number % faults.repeat_every == 0:
            self._send_whole(block, now_s)

    def _send_whole(self, block: Block, now_s: float) -> None:
        """Send a block, or as much of it as the link takes."""
        all(self.send(message, now_s) for message in block)
