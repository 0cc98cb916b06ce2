"""A loop that runs on the device itself: rows and state come in blocks, requests go out.

The device has the same compiled loop as this computer (`rig firmware tick`), gets the records of a run, and then needs nobody
between one sample and the next: limits and trips act there within a sample.
"""

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from rig.daq import DAQ, LOST
from rig.errors import DaqError, DaqMismatch, DaqRefused, as_daq_error
from rig.loop.driven_loop import end_by_driver
from rig.tick.layout import DEVICE_SHIFT, ROW, TickArrays
from rig.tick.tick import Tick
from rig.wire.messages import Rows, State

WHOLE_STATE_S, WHOLE_OUTCOME_S = 2.0, 0.1  # after the end, for outcomes that were lost on the way, and for each; chosen
ON_DEVICE = "the loop runs on the device: this computer collects its rows"


class RemoteLoop(Protocol):
    """A run of a loop on a device."""

    @property
    def block(self) -> int:
        """Rows that the device sends at a time."""

    @property
    def expected(self) -> int:
        """Index of the first sample of the next block."""

    def begin(self) -> None:
        """Start the loop, and arm the device."""

    def take(self) -> tuple[Rows | None, State | None]:
        """Wait for the next block; None if it was lost, and for its state if that was."""

    def ramp(self) -> None:
        """Ask for the ramp to 0 V."""

    def release(self) -> None:
        """Let the start segment end at its time."""

    def agrees(self, name: str, array: np.ndarray) -> bool:
        """Whether an array of the records lies in the device as it lies here."""

    def stop(self) -> None:
        """0 V, and no more rows."""


@runtime_checkable
class RunsLoops(Protocol):
    """A driver whose device may run the loop."""

    @property
    def loop(self) -> Literal["computer", "device", "auto"]:
        """Where the bench wants the loop to run."""

    @property
    def loop_digest(self) -> str:
        """Digest of the loop that the open device was built with; empty if it has none."""

    def why_no_rows(self, block: int) -> str:
        """Why the wire does not carry the rows of a loop on the open device in blocks of this size; empty if it does."""

    def why_no_room(self, sizes: Mapping[str, int]) -> str:
        """Why the open device does not hold records of these sizes (`record_sizes`); empty if it does."""

    @property
    def loop_latency_samples(self) -> float:
        """Delay from an output to its effect where the device runs the loop."""

    def load_loop(self, arrays: TickArrays, block: int) -> RemoteLoop:
        """Bring the records of a run to the open device, which then sends at most ``block`` rows at a time."""


class DeviceLoop:
    """A loop on a device: its rows one block after the other, and a copy of its state at the last one in ``tick``.

    Rows that the wire has lost keep their place: inputs that are not numbers, marked as lost.
    """

    failure: DaqError | None

    def __init__(self, daq: DAQ, remote: RemoteLoop, tick: Tick) -> None:
        self.daq, self.tick = daq, tick
        self.failure = None
        self.ended = False
        self._remote, self._block = remote, remote.block
        self._bytes = [array.reshape(-1).view(np.uint8) for array in tick.arrays]
        self._last = np.zeros(1, ROW)
        self._wants_ramp = self._wants_release = False

    def run(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Readings float32[n, n_channels] and rows [n] block by block, until the output is off; then the device is stopped."""
        while not self.ended:
            try:
                block = self._next()
                if self.tick.over:
                    self._finish()
            except Exception as error:
                self._fail(as_daq_error(error))
                return
            yield block

    def request_stop(self) -> None:
        """Request the ramp to 0 V, which is passed on with the next block."""
        self._wants_ramp = True

    def release_start(self) -> None:
        """Let the start segment end at its time; passed on with the next block."""
        self._wants_release = True

    def stop(self) -> None:
        """Stop the device at once, with 0 V, if it has not ended."""
        if not self.ended:
            self._fail(DaqError("the loop was left before its end"))

    def _next(self) -> tuple[np.ndarray, np.ndarray]:
        """The next block, with what was requested passed on before."""
        if self._wants_release:
            self._remote.release()
            self._wants_release = False
        if self._wants_ramp:
            self._remote.ramp()
            self._wants_ramp = False
        rows, state = self._remote.take()
        if state is not None:
            self._note(state)
        self.tick.arrays.loop["sample"] = self._remote.expected
        if rows is None:
            return self._lost()
        made = np.ascontiguousarray(rows.rows).view(ROW)[:, 0]
        self._last = made[-1:].copy()
        return rows.readings, made

    def _lost(self) -> tuple[np.ndarray, np.ndarray]:
        """A block in place of one that was lost: the oscillator as it would have gone on, and no readings."""
        readings, made = self.tick.buffers(self._block)
        readings.fill(np.nan)
        made[:] = self._last
        turn = 2.0 * math.pi * float(self._last["frequency_hz"][0]) / self.daq.sample_rate_hz
        theta = float(self._last["theta_rad"][0]) + turn * np.arange(1, self._block + 1)
        made["theta_rad"] = np.mod(theta, 2.0 * math.pi)
        made["phase_error_rad"] = np.nan
        made["flags"] |= np.uint32(LOST << DEVICE_SHIFT)
        self._last["theta_rad"] = made["theta_rad"][-1]
        return readings, made

    def _note(self, state: State) -> None:
        for piece in state.pieces:
            if piece.array >= len(self._bytes):
                continue
            place = self._bytes[piece.array][piece.offset : piece.offset + len(piece.data)]
            if place.size == len(piece.data):
                place[:] = np.frombuffer(piece.data, np.uint8)

    def _finish(self) -> None:
        """Stop the device once all outcomes are known here; those lost on the way come again with later blocks."""
        longest_s = WHOLE_STATE_S + WHOLE_OUTCOME_S * self.tick.outcomes.size
        until, sample = time.monotonic() + longest_s, self.tick.sample
        while not self._remote.agrees("outcomes", self.tick.outcomes) and time.monotonic() < until:
            _, state = self._remote.take()
            if state is not None:
                self._note(state)
        self.tick.arrays.loop["sample"] = sample  # of the last rows, not of those that were taken for their state
        self._remote.stop()
        self.ended = True

    def _fail(self, failure: DaqError) -> None:
        self.ended, self.failure = True, failure
        end_by_driver(self.tick, failure)
        with suppress(Exception):  # the device may be gone; its watchdog brings the output to 0 V
            self._remote.stop()


def why_on_computer(daq: RunsLoops, block: int) -> str:
    """Why the computer runs the loop of an open device, as far as known before there is a plan; empty if the device does.

    ``block``: rows that the device would send at a time. A bench with ``loop = "computer"`` is no reason to tell.

    Raises `DaqMismatch` if the bench asks for a loop on the device and the device has none, or another one than this computer;
    `DaqRefused`, with the sum, if the wire does not carry its rows.
    """
    if why := daq.why_no_rows(block):
        if daq.loop == "auto":
            return why
        raise DaqRefused(why)
    theirs, why = daq.loop_digest, "the device has no loop of its own"
    if theirs:
        from rig.firmware.machine_code import kernels_digest

        ours = kernels_digest()
        if theirs == ours:
            return ""
        why = f"the device has another loop ({theirs[:12]}, here {ours[:12]}): build its firmware anew"
    if daq.loop == "auto":
        return why
    raise DaqMismatch(why, field="driver.options.loop", value=daq.loop, allowed="'computer' or 'auto' with this device")


def record_sizes(arrays: TickArrays) -> dict[str, int]:
    """Bytes of each of the records that a device needs for a run, by name."""
    return {name: array.nbytes for name, array in zip(TickArrays._fields, arrays, strict=False)}
