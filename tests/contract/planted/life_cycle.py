"""Faults of the life cycle: opening, starting, closing, refusing."""

import os
import threading

import numpy as np

from rig.daq import State
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqBusy, DaqRefused
from tests.contract.planted.table import planted


@planted("nothing_is_opened_by_the_constructor")
class OpensItself(VirtualDAQ):
    """Opened by its constructor."""

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self.open()

    def open(self):
        if self.state is State.CLOSED:
            super().open()


@planted("the_life_cycle_is_open_start_stop_close")
class DoesNotStart(VirtualDAQ):
    """Start does nothing."""

    def start(self, block=1):
        pass


@planted("close_may_be_called_at_any_time_and_again")
class FailsWhereGone(VirtualDAQ):
    """Close fails if the device is not open."""

    def close(self):
        if self.state is State.CLOSED:
            raise RuntimeError("not open")
        super().close()


@planted("close_may_be_called_at_any_time_and_again")
class FailsToClose(VirtualDAQ):
    """Close fails always."""

    def _close(self):
        raise RuntimeError("cannot close twice")


@planted("a_driver_may_be_opened_again")
class CannotStartAgain(VirtualDAQ):
    """The same driver cannot be opened a second time."""

    opened = 0

    def _open(self):
        self.opened += 1
        if self.opened > 1:
            raise DaqRefused("once is enough")
        super()._open()


@planted("another_driver_may_open_what_one_has_closed")
class KeepsTheDevice(VirtualDAQ):
    """Close does not let go of the device: the next driver finds it in use."""

    holder = None

    def _open(self):
        if KeepsTheDevice.holder not in (None, self):
            raise DaqBusy("the device is in use")
        KeepsTheDevice.holder = self
        super()._open()


@planted("an_error_inside_the_context_closes")
class StaysOpenAfterAnError(VirtualDAQ):
    """The context does not close after an error."""

    def __exit__(self, kind, error, trace):
        if kind is None:
            self.close()


@planted("steps_out_of_order_are_refused")
class ExchangesBeforeStart(VirtualDAQ):
    """Exchange before start returns zeros."""

    def exchange(self, voltages):
        if self.state is State.OPEN and not self.block:
            return np.zeros((len(voltages), len(self.channels)))
        return super().exchange(voltages)


@planted("steps_out_of_order_are_refused")
class ExchangesAfterClose(VirtualDAQ):
    """Exchange after stop or close returns zeros."""

    def exchange(self, voltages):
        if self.block and self.state is not State.RUNNING:
            return np.zeros((self.block, len(self.channels)))
        return super().exchange(voltages)


@planted("blocks_beyond_the_device_are_refused_with_what_is_allowed")
class TakesAnyBlock(VirtualDAQ):
    """A block of any size is accepted and clipped."""

    def start(self, block=1):
        super().start(max(1, min(block, self.capabilities.largest_block)))


@planted("voltages_beyond_the_range_or_not_a_number_are_refused")
class ClipsInSilence(VirtualDAQ):
    """Outputs beyond the range are clipped, not refused."""

    def exchange(self, voltages):
        return super().exchange(np.clip(np.nan_to_num(voltages), -self.output_range_v, self.output_range_v))


@planted("voltages_beyond_the_range_or_not_a_number_are_refused")
class TakesAnyVoltage(VirtualDAQ):
    """Any voltage is accepted, and nothing is answered."""

    def exchange(self, voltages):
        return np.zeros((self.block, len(self.channels)))


@planted("a_block_of_another_size_is_refused")
class TakesAnyShape(VirtualDAQ):
    """A block of another size is accepted."""

    def exchange(self, voltages):
        return super().exchange(np.resize(voltages, self.block))


@planted("closed_after_a_refusal_a_driver_can_be_used_again")
class SulksAfterARefusal(VirtualDAQ):
    """Does not open any more after it has refused something."""

    refused = False

    def exchange(self, voltages):
        try:
            return super().exchange(voltages)
        except DaqRefused:
            self.refused = True
            raise

    def _open(self):
        if self.refused:
            raise DaqBusy("still offended")
        super()._open()


@planted("close_leaves_nothing_behind")
class LeavesAThread(VirtualDAQ):
    """A reader thread goes on after close."""

    def _start(self):
        super()._start()
        self.over = threading.Event()
        threading.Thread(target=self.over.wait, args=(3.0,), daemon=True).start()


@planted("close_leaves_nothing_behind")
class LeavesAFile(VirtualDAQ):
    """The port stays open after close."""

    port = None

    def _open(self):
        super()._open()
        self.port = os.open(os.devnull, os.O_RDONLY)

    def __del__(self):
        if self.port is not None:
            os.close(self.port)


@planted("capabilities_are_the_same_before_and_while_running")
class ChangesItsMind(VirtualDAQ):
    """Says that something moves only once it is running."""

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"virtual": self.state is not State.RUNNING})


@planted("the_device_says_who_it_is_in_words")
class IdentifiesItselfByNumber(VirtualDAQ):
    """Identity is a number."""

    @property
    def identity(self):
        return {"serial_number": 42}


@planted("counters_are_whole_numbers_that_only_grow")
class CountsDown(VirtualDAQ):
    """A counter counts down."""

    calls = 0

    @property
    def counters(self):
        return {"crc_errors": 100 - self.calls}

    def _exchange(self, voltages, inputs):
        self.calls += 1
        super()._exchange(voltages, inputs)


@planted("rate_range_and_channels_are_those_of_the_bench")
class SaysAnotherRate(VirtualDAQ):
    """The sample rate is declared wrong."""

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self.sample_rate_hz = 0.5 * bench.sample_rate_hz


@planted("rate_range_and_channels_are_those_of_the_bench")
class SaysAnotherRange(VirtualDAQ):
    """The output range is declared wrong."""

    def _start(self):
        super()._start()
        self.output_range_v *= 2.0
