"""The DAQ contract: everything above it works with any driver that keeps it.

A driver swaps blocks of samples with a device. With ``n`` samples a block and a queue of ``q`` blocks in the device,
call j of `DAQ.exchange` returns the inputs of the instants ``j n ... j n + n - 1``, in volts, once all are measured; the
outputs handed over in call j are on the converter at the instants ``(j + q) n ... (j + q) n + n - 1``. ``q = 0`` with
``n = 1`` is sample-synchronous hardware.
"""

from abc import ABC, abstractmethod
from enum import Enum
from types import TracebackType
from typing import ClassVar, Self

import numpy as np
from pydantic import Field

from rig.bench.channels import Channel, Role
from rig.bench.configuration import Configured
from rig.errors import DaqError, DaqRefused, RigError, as_daq_error

__all__ = ["DAQ", "LOST", "Capabilities", "Channel", "Role", "State"]

LOST = 1 << 15
"""Bit of `DAQ.flags`: the sample was lost on its way, its inputs are NaN."""


class Capabilities(Configured):
    """What a driver can do; the conformance suite and the loop ask here instead of for its type."""

    largest_block: int = Field(ge=1)
    """Largest number of samples a call may swap."""
    paced: bool
    """Whether `DAQ.exchange` blocks until the samples are measured (a clock paces it); a virtual rig returns at once."""
    virtual: bool
    """Whether nothing physical moves: such a rig may arm itself."""
    repeatable: bool
    """Whether two runs with the same outputs return the same inputs."""
    safe_without_host: bool = False
    """Whether the output comes to 0 V by the device's own means when the host's process is killed. The conformance suite
    kills one; where it is false, a person arms, or a hardware emergency stop is declared."""


class State(Enum):
    """Life cycle of a driver."""

    CLOSED = "closed"
    OPEN = "open"
    RUNNING = "running"


class _AsDaqError:
    """Turns whatever a driver raises into a `DaqError`; so nobody above has to know the exceptions of a vendor."""

    def __enter__(self) -> None:
        """Nothing."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, Exception) and not isinstance(error, RigError):
            raise as_daq_error(error) from error


_AS_DAQ_ERROR = _AsDaqError()


class DAQ(ABC):
    """A data acquisition device with one output and several inputs.

    ``open -> start -> exchange ... -> stop -> close``, or as a context manager, which opens and closes. Nothing is opened
    by the constructor. `close` may be called at any time, any number of times, and leaves the output at 0 V; so does
    `stop`. A driver implements the methods with a leading underscore and leaves the rest alone.

    Whoever ends a run calls `exchange_zeros` and then `stop`: 0 V is handed over like any other output, and by the driver's
    own means besides. Neither relies on the other.

    ``flags`` (uint16[n]) are the device's own remarks on each sample of the last block, as bits: a driver that has any fills it
    in `_exchange` and names the bits, lowest first, by its `counters`. Samples that were lost on their way are rows of NaN with
    the bit `LOST`, in their place: the count of rows is the device's count of instants. `start` arms the device; whether it may
    be started at all is decided above, by a person. What the device has `latched` it keeps until `clear`, which a run calls.

    Errors: `DaqRefused` for what the device or the present state cannot do, `DaqTimeout`, `DaqDisconnected`,
    `DaqOverrun` and the others of `rig.errors` for what happens on the way; a driver's other exceptions become `DaqError`.
    """

    wall_clock: ClassVar[bool] = True
    """Whether there is a device behind it that has a clock, so that its loop wants a process of its own."""

    def __init__(self, channels: tuple[Channel, ...], sample_rate_hz: float, output_range_v: float) -> None:
        self.channels = channels
        self.sample_rate_hz = sample_rate_hz
        self.output_range_v = output_range_v
        self.block = 0
        self.flags = np.zeros(0, np.uint16)
        self.state = State.CLOSED
        self._driven = False
        self._blocks_of_zero = 0

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """What this driver can do."""

    @property
    @abstractmethod
    def latency_samples(self) -> float:
        """``u[i]`` shows at ``y[i + latency_samples]``: queue, hold, converter and filter delay; known once started."""

    @property
    def filter_delay_samples(self) -> float:
        """The part of the latency that is the mean delay of filters: an output begins to show that much earlier."""
        return 0.0

    @property
    def queue_blocks(self) -> int:
        """q: whole blocks between the handing over of an output and the converter; known once started."""
        return max(0, int((self.latency_samples - self.filter_delay_samples) // self.block))

    @property
    def counters(self) -> dict[str, int]:
        """What went wrong so far, counted: lost samples, clipped outputs and inputs, and the like."""
        return {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks odd about the bench to the driver, one line each; a run prints and records them."""
        return ()

    @property
    def latched(self) -> str:
        """What the device had latched when it was opened, in words: its watchdog, an emergency stop; empty for nothing."""
        return ""

    def clear(self) -> None:  # noqa: B027 (most devices latch nothing)
        """Have the device forget what is `latched`, and nothing that latched later; only for a run that is armed."""

    @property
    def identity(self) -> dict[str, str]:
        """What stands behind the driver, for the record: port, model, firmware, serial number; known once open."""
        return {}

    @property
    def statistics(self) -> dict[str, float]:
        """What was measured of the wire so far, for the record: bus load, round trips and the like, unit in the name."""
        return {}

    @abstractmethod
    def _open(self) -> None:
        """Find and open the device, compare its channels with ours; output 0 V."""

    @abstractmethod
    def _start(self) -> None:
        """Begin sampling with blocks of ``self.block``."""

    @abstractmethod
    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        """Swap one block: ``voltages`` float64[n] out, ``inputs`` float64[n, n_channels] to be filled."""

    @abstractmethod
    def _stop(self) -> None:
        """Output to 0 V, end sampling."""

    @abstractmethod
    def _close(self) -> None:
        """Output to 0 V, let go of the device. Must not fail because the device is gone."""

    def open(self) -> None:
        """Open the device."""
        if self.state is not State.CLOSED:
            raise DaqRefused(f"the device is {self.state.value} already; close it before opening it again")
        with _AS_DAQ_ERROR:
            self._open()
        self.state = State.OPEN

    def start(self, block: int = 1) -> None:
        """Begin sampling with ``block`` samples a call, fixed until `stop`."""
        if self.state is not State.OPEN:
            raise DaqRefused(f"the device is {self.state.value}; it can be started when it is open")
        largest = self.capabilities.largest_block
        if not 1 <= block <= largest:
            raise DaqRefused(f"block = {block}: allowed is 1 to {largest} samples")
        self.block = block
        self.flags = np.zeros(block, np.uint16)
        self._driven = False
        with _AS_DAQ_ERROR:
            self._start()
        self.state = State.RUNNING

    def exchange(self, voltages: np.ndarray) -> np.ndarray:
        """Swap one block: float64[n] volts out for float64[n, n_channels] volts in.

        Voltages beyond the output range, or that are not numbers, are refused before anything is sent.
        """
        if self.state is not State.RUNNING:
            raise DaqRefused(f"the device is {self.state.value}; samples are exchanged while it is running")
        if voltages.shape != (self.block,):
            raise DaqRefused(
                f"voltages of shape {voltages.shape}: allowed is ({self.block},), the block given to start"
            )
        largest = np.abs(voltages).max()
        if not largest <= self.output_range_v:
            worst = float(voltages[np.argmax(np.where(np.isfinite(voltages), np.abs(voltages), np.inf))])
            raise DaqRefused(f"an output of {worst:g} V was demanded: allowed is +-{self.output_range_v:g} V")
        if largest > 0.0:
            self._driven, self._blocks_of_zero = True, 0
        inputs = np.empty((self.block, len(self.channels)))
        with _AS_DAQ_ERROR:
            self._exchange(voltages, inputs)
        self._blocks_of_zero += int(largest == 0.0)
        return inputs

    def exchange_zeros(self) -> None:
        """Exchange 0 V until the last of what was driven is off the converter; for whoever ends a run, before `stop`.

        At most the blocks of the queue and one more; fewer after blocks of 0 V, and where a block fails, which is no error
        here: a device that does not answer any more is left to `stop`.
        """
        if self.state is not State.RUNNING or not self._driven:
            return
        try:
            for _ in range(self.queue_blocks + 1 - self._blocks_of_zero):
                self.exchange(np.zeros(self.block))
        except Exception:
            return

    def stop(self) -> None:
        """Output to 0 V and end sampling; no effect unless running."""
        if self.state is not State.RUNNING:
            return
        self.state = State.OPEN
        with _AS_DAQ_ERROR:
            self._stop()

    def close(self) -> None:
        """Output to 0 V and let go of the device; any time, any number of times."""
        if self.state is State.CLOSED:
            return
        try:
            self.stop()
        except DaqError:
            pass  # the device may be gone, which is a reason to close it
        finally:
            self.state = State.CLOSED
            with _AS_DAQ_ERROR:
                self._close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
