"""The part of the loop common to all processes: exchange blocks, and bring the output to 0 V whatever the driver raises."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from rig.daq import CONTINUED, DAQ, HELD, LOST, flag_names
from rig.errors import DaqError, as_daq_error
from rig.tick.kernels import tick_block
from rig.tick.safety.layout import GuardMode
from rig.tick.safety.limits import end_reason_of
from rig.tick.tick import Tick
from vibrolock.compiled import bound

Block: TypeAlias = tuple[np.ndarray, np.ndarray]
"""A block of inputs, V [n, n_channels], and the device's flags [n]."""


def end_by_driver(tick: Tick, error: DaqError) -> None:
    """Record in the guard that the driver has failed, so that the output counts as off."""
    guard = tick.guard
    if guard["mode"][0] in (GuardMode.ARMED, GuardMode.DISARMED):
        guard["reason"] = end_reason_of(error)
        guard["sample"] = tick.sample
    guard["mode"] = GuardMode.OFF
    guard["amplitude_v"] = 0.0


class DrivenLoop:
    """Base class of both loops: a tick over a started driver.

    An exception of the driver ends the loop and is stored as ``failure``. An exception that is no error, such as
    `KeyboardInterrupt` or `SystemExit` raised inside the driver, is stored as ``interruption``. It requests the ramp, and the
    interrupted block counts as lost. A second interruption is a failure.
    """

    failure: DaqError | None
    cause: str

    def __init__(self, daq: DAQ, tick: Tick) -> None:
        self.daq, self.tick = daq, tick
        self.failure = None
        self.cause = ""
        self.interruption: BaseException | None = None
        self._counted: dict[str, int] | None = None
        self._voltages = np.zeros(daq.block)
        tick.arrays.loop["queue_whole"] = daq.block + daq.queue_samples
        flags = flag_names(daq.counters)
        for field, name in (("held_flag", HELD), ("continued_flag", CONTINUED)):
            tick.arrays.loop[field] = 1 << flags.index(name) if name in flags else 0

    @property
    def counters(self) -> dict[str, int]:
        """The driver's counters at the last row; the blocks of 0 V after it are not counted."""
        return dict(self.daq.counters) if self._counted is None else self._counted

    def stop(self) -> None:
        """Exchange 0 V until the device's queue is flushed, then stop the device; may be called any number of times.

        An error becomes the loop's failure unless there is one already. The device is told to stop in any case.
        """
        for step in (self._keep_counters, self.daq.exchange_zeros, self.daq.stop):
            try:
                step()
            except Exception as error:
                self.failure = self.failure or as_daq_error(error)
            except BaseException as error:
                self.interruption = self.interruption or error

    def _bound_tick(self, readings: np.ndarray, rows: np.ndarray) -> Callable[..., None]:
        """`tick_block` for blocks of the device and these arrays for readings and rows, which are not changed."""
        daq = self.daq
        inputs, told = np.empty((daq.block, len(daq.channels))), (daq.put_out, daq.continuation)
        return bound(tick_block, self.tick.arrays, inputs, daq.flags, readings, rows, self._voltages, *told)

    def _keep_counters(self) -> None:
        if self._counted is None:
            self._counted = {}
            self._counted = dict(self.daq.counters)

    def _swap(self) -> Block | None:
        """Exchange the present voltages for the next block; None if the loop has failed."""
        daq = self.daq
        try:
            return daq.exchange(self._voltages), daq.flags
        except Exception as error:
            self._fail(as_daq_error(error))
        except BaseException as error:  # KeyboardInterrupt, SystemExit: the rig is ramped down first
            if self.interruption is None:
                return self._interrupted(error)
            self._fail(DaqError(f"{type(error).__name__} was raised in the driver again while the output came down"))
        return None

    def _fail(self, error: DaqError) -> None:
        self.failure = error
        end_by_driver(self.tick, error)

    def _interrupted(self, error: BaseException) -> Block:
        """Ask for the ramp; the block whose exchange was interrupted counts as lost samples."""
        self.interruption = error
        if not self.cause and int(self.tick.guard["mode"][0]) == GuardMode.ARMED:
            self.cause = " ".join(f"{type(error).__name__} was raised in the driver: {error}".split()).rstrip(":")
        self.tick.request_stop()
        daq = self.daq
        daq.put_out.fill(np.nan)
        return np.full((daq.block, len(daq.channels)), np.nan), np.full(daq.block, LOST, np.uint16)
