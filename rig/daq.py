"""The DAQ contract, which every driver must keep; all other code relies on it alone.

A driver exchanges blocks of samples with a device. With ``n`` samples a block and a queue of ``q`` blocks in the device,
call j of `DAQ.exchange` returns the inputs of the instants ``j n ... j n + n - 1``, in volts, once all are measured. The
outputs passed in call j are on the converter at the instants ``(j + q) n ... (j + q) n + n - 1``. ``q = 0`` with ``n = 1`` is
sample-synchronous hardware.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import Enum
from typing import NamedTuple, Self

import numpy as np
from pydantic import Field

from rig.bench.channels import Channel, Role
from rig.bench.configuration import Configured
from rig.errors import DaqError, DaqRefused, RigError, as_daq_error
from vibrolock.compiled import bound, kernel

__all__ = [
    "CONTINUATION",
    "CONTINUED",
    "DAQ",
    "HELD",
    "LOST",
    "Adjustable",
    "Capabilities",
    "Channel",
    "Image",
    "Role",
    "State",
    "flag_names",
]

LOST = 1 << 15
"""Bit of `DAQ.flags`: the sample was lost in transfer; its inputs are NaN."""
HELD = "output_held"
"""Name of the flag of a sample at which the converter repeated its last output, because the next one came too late."""
CONTINUED = "output_continued"
"""Name of the flag of a sample at which the device went on with the last period of outputs, because the next came too late."""

CONTINUATION = np.dtype([("period_samples", "f8"), ("ramp_samples", "f8")])
"""How the outputs of a block go on, for a device that goes on with them when the next ones come too late (one record).
``period_samples``: their period, 0 if they have none. ``ramp_samples``: samples from the end of the block until a ramp to 0 V
has ended, 0 if there is no ramp."""


def flag_names(counters: Iterable[str]) -> list[str]:
    """Return the names of the device's flags, lowest bit first: the driver's first counters, one for each bit below `LOST`."""
    return [*counters][: LOST.bit_length() - 1]


class Capabilities(Configured):
    """Capabilities of a driver; the conformance suite and the loop check these instead of the driver's type."""

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


class Adjustable(NamedTuple):
    """What a driver's options set against outputs that come too late, and how far; for ``rig doctor --daq``.

    A driver that has them names its options ``queue_blocks`` and ``watchdog_s``.
    """

    watchdog_s: float
    """Watchdog that is in force with the present options, s."""
    largest_queue: int
    """Longest queue of driver and device, blocks."""
    watchdog_range_s: tuple[float, float]
    """Shortest and longest watchdog that driver and device allow, s."""
    rate_range_hz: tuple[float, float]
    """Lowest and highest sample rate of the device, Hz."""
    wire_share: dict[int, float]
    """Part of the wire's capacity that the stream takes at the bench's sample rate, by samples a block; 0 without a limit."""
    largest_wire_share: float
    """Part of the wire's capacity that a stream may take."""
    automatic: bool = False
    """Whether the bench leaves the queue to what is measured before a run (`rig.loop.worker.queue_choice`)."""
    longest_period: int = 0
    """Longest period, samples, with which the device goes on where outputs come too late; 0 if it holds the last one."""
    buffered_blocks: int = 0
    """Blocks of outputs that lie ahead in the device's buffer besides the queue, with the bench's block."""


class Image(NamedTuple):
    """Error of the force reading near a resonance by images of the held output, which sampling folds back onto it."""

    frequency_hz: float
    """Frequency of the resonance, Hz."""
    in_phase_n_per_v: float
    """Part in phase with the force at phase resonance, per V of the output's amplitude, N/V; it is taken for damping."""
    ahead_n_per_v: float
    """Part a quarter period ahead of it, N/V; it shifts the frequency."""


IMAGES_ACCEPTED = 0.1
"""Share of the measured damping that images may have in a point of a test that asks for damping; chosen."""


class State(Enum):
    """Life cycle of a driver."""

    CLOSED = "closed"
    OPEN = "open"
    RUNNING = "running"


RUNNING = State.RUNNING  # a member of an Enum is looked up slowly, and `DAQ.exchange` asks for it at every block


@kernel
def largest_of(voltages: np.ndarray) -> float:
    """Return the largest magnitude among ``voltages``; NaN if one of them is."""
    largest = 0.0
    for voltage in voltages:
        if math.isnan(voltage):
            return math.nan
        largest = max(largest, abs(voltage))
    return largest


@contextmanager
def _as_daq_errors() -> Iterator[None]:
    """Convert any other exception of a driver into a `DaqError`; callers need not know a vendor's exceptions."""
    try:
        yield
    except RigError:
        raise
    except Exception as error:
        raise as_daq_error(error) from error


class DAQ(ABC):
    """A data acquisition device with one output and several inputs.

    The order of calls is ``open -> start -> exchange ... -> stop -> close``. The constructor opens nothing; as a context
    manager the object opens and closes itself. `close` may be called at any time, any number of times. `stop` and `close`
    leave the output at 0 V. To end a run, call `exchange_zeros` and then `stop`: the first sends 0 V like any other output,
    the second sets 0 V by the driver's own means, and neither relies on the other.

    A driver implements the methods of the first section below, and overrides those of the second as its device allows. It may
    call `do_meanwhile`, and fills these arrays, which `start` makes, in `_exchange`:

    ``flags``
        uint16[n]: status bits of the device for each sample of the last block. The keys of `counters` name the bits, lowest
        first. A lost sample keeps its place as a row of NaN with the bit `LOST`, so that rows count the device's instants.
    ``put_out``
        float64[n], V: NaN where the converter put out what was handed over for an instant of the last block, and otherwise what
        it put out instead. A driver that is not told leaves it alone.

    ``continuation`` (`CONTINUATION`, one record) is filled by the caller before `exchange` and says how the outputs that it
    passes go on; a driver may ignore it.

    `start` arms the device; a person at a higher level decides whether it may be started. A condition that the device has
    `latched` stays until `clear`, which a run calls.

    Raises
    ------
    DaqRefused
        For a request that the device or its present state does not allow.
    DaqError
        For faults during operation: `DaqTimeout`, `DaqDisconnected`, `DaqOverrun` and the others of `rig.errors`. Any other
        exception of a driver becomes a `DaqError`.
    """

    wall_clock: bool = True
    """Whether the device has its own clock, so that its loop should run in a separate process."""

    def __init__(self, channels: tuple[Channel, ...], sample_rate_hz: float, output_range_v: float) -> None:
        self.channels = channels
        self.sample_rate_hz = sample_rate_hz
        self.output_range_v = output_range_v
        self.block = 0
        self.flags = np.zeros(0, np.uint16)
        self.put_out = np.zeros(0)
        self.continuation = np.zeros(1, CONTINUATION)
        self.meanwhile: Callable[[], None] | None = None
        """Work of the caller for the next `exchange`, see `do_meanwhile`."""
        self.state = State.CLOSED
        self._driven = False
        self._blocks_of_zero = 0

    # What a driver implements

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver."""

    @property
    @abstractmethod
    def latency_samples(self) -> float:
        """Delay from an output to its effect: ``u[i]`` shows at ``y[i + latency_samples]``; known once started.

        It includes queue, hold, converter and filter delay.
        """

    @abstractmethod
    def _open(self) -> None:
        """Find and open the device, compare its channels with ``self.channels``, and set the output to 0 V."""

    @abstractmethod
    def _start(self) -> None:
        """Begin sampling with blocks of ``self.block``."""

    @abstractmethod
    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        """Exchange one block: send ``voltages`` float64[n] and fill ``inputs`` float64[n, n_channels] (V)."""

    @abstractmethod
    def _stop(self) -> None:
        """Set the output to 0 V and end sampling."""

    @abstractmethod
    def _close(self) -> None:
        """Set the output to 0 V and release the device. Must not fail because the device is gone."""

    # What a driver overrides where its device has more to say

    @property
    def filter_delay_samples(self) -> float:
        """Mean delay of the filters, as part of the latency; an output begins to show this much before the full latency."""
        return 0.0

    @property
    def queue_samples(self) -> int:
        """Whole samples between `exchange` of an output and the converter; known once started."""
        return max(0, int(self.latency_samples - self.filter_delay_samples))

    @property
    def counters(self) -> dict[str, int]:
        """Counts of faults so far: lost samples, clipped outputs and inputs, and the like."""
        return {}

    @property
    def identity(self) -> dict[str, str]:
        """Identity of the device for the recording: port, model, firmware, serial number; known once open."""
        return {}

    @property
    def statistics(self) -> dict[str, float]:
        """Transfer statistics so far, for the recording: bus load, round trips and the like, with the unit in the name."""
        return {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings of the driver about the bench, one line each; a run prints and records them."""
        return ()

    @property
    def images(self) -> tuple[Image, ...]:
        """Images of the held output in the force reading, by resonance; empty where filters keep them out or none are known."""
        return ()

    def image_shares(self, frequency_hz: np.ndarray) -> dict[str, np.ndarray]:
        """Images of the held output in each channel at float[n] Hz, relative to what it reads of the output, complex[n].

        Of small vibrations, with the filters of the inputs; empty if they are not known. The device need not be open.
        """
        return {}

    @property
    def latched(self) -> str:
        """Conditions that the device had latched when it was opened, in words (watchdog, emergency stop); empty if none."""
        return ""

    def clear(self) -> None:  # noqa: B027 (most devices latch nothing)
        """Reset the conditions in `latched`, but none that latched later; only for an armed run."""

    @property
    def adjustable(self) -> Adjustable | None:
        """What the driver's options set against late outputs; known once open, None where there is nothing to set."""
        return None

    def adjust(self, queue_blocks: int, watchdog_s: float | None = None) -> None:
        """Take another queue, and another watchdog than the bench's if one is given, from the next `start` on.

        A driver overrides this if it has `adjustable`. It is called while the device is open and not running.
        """
        raise DaqRefused("this driver has no queue that can be set", field="queue_blocks", value=queue_blocks)

    # What callers use; no driver overrides it

    @property
    def queue_blocks(self) -> int:
        """q: whole blocks between `exchange` of an output and the converter; known once started."""
        return self.queue_samples // self.block

    def open(self) -> None:
        """Open the device."""
        if self.state is not State.CLOSED:
            raise DaqRefused(f"the device is {self.state.value} already; close it before opening it again")
        with _as_daq_errors():
            self._open()
        self.state = State.OPEN

    def start(self, block: int = 1) -> None:
        """Begin sampling with ``block`` samples a call, fixed until `stop`."""
        if self.state is not State.OPEN:
            raise DaqRefused(f"the device is {self.state.value}; it can be started when it is open")
        largest = self.capabilities.largest_block
        if not 1 <= block <= largest:
            raise DaqRefused(field="block", value=block, allowed=f"1 to {largest} samples")
        self.block = block
        self.flags = np.zeros(block, np.uint16)
        self.put_out = np.full(block, math.nan)
        self.continuation[:] = 0.0
        self._arrays_made = self.flags, self.put_out
        self._shape = block, len(self.channels)
        self._largest_of = bound(largest_of, np.zeros(block))
        self._driven = False
        with _as_daq_errors():
            self._start()
        self.state = State.RUNNING

    def exchange(self, voltages: np.ndarray) -> np.ndarray:
        """Exchange one block: send float64[n] (V) and return the inputs float64[n, n_channels] (V).

        Voltages beyond the output range, or that are not finite, are refused before anything is sent.
        """
        if self.state is not RUNNING:
            raise DaqRefused(f"the device is {self.state.value}; samples are exchanged while it is running")
        if voltages.shape != (self.block,):
            raise DaqRefused(
                f"voltages of shape {voltages.shape}: allowed is ({self.block},), the block given to start"
            )
        voltages = np.ascontiguousarray(voltages, float)
        largest = self._largest_of(voltages)
        if not largest <= self.output_range_v:
            worst = float(voltages[np.argmax(np.where(np.isfinite(voltages), np.abs(voltages), np.inf))])
            raise DaqRefused(f"an output of {worst:g} V was demanded: allowed is +-{self.output_range_v:g} V")
        if largest > 0.0:
            self._driven, self._blocks_of_zero = True, 0
        inputs = np.empty(self._shape)
        try:  # not `_as_daq_errors`, which takes as long as a short block
            self._exchange(voltages, inputs)
        except RigError:
            raise
        except Exception as error:
            raise as_daq_error(error) from error
        finally:
            if self.meanwhile is not None:
                self.do_meanwhile()
        flags, put_out = self._arrays_made  # the loop's machine code takes them as they were made
        if self.flags is not flags or self.put_out is not put_out:
            raise DaqError("the driver has replaced `flags` or `put_out`; allowed is to fill what `start` has made")
        self._blocks_of_zero += int(largest == 0.0)
        return inputs

    def do_meanwhile(self) -> None:
        """Do the caller's work once. A driver may call this where outputs are sent and the block is awaited: no time is lost.

        Otherwise it is done at the end of `exchange`.
        """
        work, self.meanwhile = self.meanwhile, None
        if work is not None:
            work()

    def exchange_zeros(self) -> None:
        """Exchange blocks of 0 V until the last nonzero output has left the converter; called before `stop` ends a run.

        At most the blocks of the queue and one more are exchanged, fewer if blocks of 0 V were sent before. A failing block
        ends the exchange without an error, because `stop` handles a device that no longer answers.
        """
        if self.state is not State.RUNNING or not self._driven:
            return
        self.continuation[:] = 0.0
        try:
            for _ in range(self.queue_blocks + 1 - self._blocks_of_zero):
                self.exchange(np.zeros(self.block))
        except Exception:
            return

    def stop(self) -> None:
        """Set the output to 0 V and end sampling; no effect unless running."""
        if self.state is not State.RUNNING:
            return
        self.state = State.OPEN
        with _as_daq_errors():
            self._stop()

    def close(self) -> None:
        """Set the output to 0 V and release the device; may be called at any time, any number of times."""
        if self.state is State.CLOSED:
            return
        try:
            self.stop()
        except DaqError:
            pass  # the device may be gone, which is a reason to close it
        finally:
            self.state = State.CLOSED
            with _as_daq_errors():
                self._close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
