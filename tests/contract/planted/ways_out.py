"""Faults of 0 V: after opening, starting, stopping, closing, and after errors."""

import numpy as np

from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqError
from tests.contract.planted.drivers import QueuedUnseenDAQ
from tests.contract.planted.table import planted

STOP = "stop_alone_brings_the_output_to_0_v"
CLOSE = "close_alone_brings_the_output_to_0_v"
BEGIN = "open_and_start_leave_the_output_at_0_v"
INTERRUPTED = "an_interruption_in_exchange_ends_at_0_v"


@planted(STOP)
class DoesNotStop(VirtualDAQ):
    """Stop does nothing."""

    def _stop(self):
        pass

    def _close(self):
        super()._stop()


@planted(CLOSE)
class DoesNotClose(VirtualDAQ):
    """Close does nothing."""

    def _close(self):
        pass


@planted(STOP)
class DoesNotStopUnseen(QueuedUnseenDAQ):
    """Stop does nothing, and a loopback behind a queue is the only witness."""

    def _stop(self):
        pass

    def _close(self):
        self._rest()


@planted(CLOSE)
class DoesNotCloseUnseen(QueuedUnseenDAQ):
    """Close does nothing, and a loopback behind a queue is the only witness."""

    def _close(self):
        pass


@planted(STOP)
class StopsHalfway(VirtualDAQ):
    """Stop leaves half of the output."""

    def _stop(self):
        left = 0.5 * self.output_v
        super()._stop()
        self._exchanged.loopback.past[:] = left

    def _close(self):
        super()._stop()


@planted(BEGIN)
class OpensAt1V(VirtualDAQ):
    """1 V on the output after open."""

    def _open(self):
        super()._open()
        self._exchanged.loopback.past[:] = 1.0


@planted(BEGIN)
class StartsAt1V(VirtualDAQ):
    """1 V on the output after start."""

    def _start(self):
        super()._start()
        self._exchanged.loopback.past[:] = 1.0


@planted(BEGIN)
class StartsWithTheOldOutput(VirtualDAQ):
    """The old output again at start."""

    last_v = 0.0

    def _start(self):
        super()._start()
        self._exchanged.loopback.past[:] = self.last_v

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.last_v = voltages[-1] or self.last_v


@planted("a_restart_begins_with_0_v_in_the_loopback")
class StartsWithTheOldQueue(QueuedUnseenDAQ):
    """The old queue is put out at start, and a loopback is the only witness."""

    last_v = 0.0

    def _start(self):
        super()._start()
        self._exchanged.queue[:] = self.last_v

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.last_v = voltages[-1] or self.last_v


@planted("0_v_that_are_exchanged_are_on_the_converter")
class KeepsItsQueue(VirtualDAQ):
    """Says that 0 V are out, and has not put them out."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages if voltages.any() else np.full_like(voltages, 0.05), inputs)


@planted("an_exception_in_exchange_ends_at_0_v")
class StaysDrivenAfterAnException(VirtualDAQ):
    """Its stop exchanges a block, and gives up where that fails."""

    def _stop(self):
        self._exchange(np.zeros(self.block), np.zeros((self.block, len(self.channels))))
        super()._stop()

    def _close(self):
        super()._stop()


@planted("an_exception_in_exchange_ends_at_0_v")
class HoldsAfterAnException(VirtualDAQ):
    """Holds its output after an exception."""

    failed = False

    def exchange(self, voltages):
        try:
            return super().exchange(voltages)
        except DaqError:
            self.failed = True
            raise

    def _rest(self):
        if not self.failed:
            super()._rest()


class Interrupted(VirtualDAQ):
    interrupted = False

    def exchange(self, voltages):
        try:
            return super().exchange(voltages)
        except KeyboardInterrupt:
            self.interrupted = True
            raise


@planted(INTERRUPTED)
class HoldsAfterAnInterruption(Interrupted):
    """Holds its output after KeyboardInterrupt."""

    def _rest(self):
        if not self.interrupted:
            super()._rest()


@planted(INTERRUPTED)
class SwallowsAnInterruption(VirtualDAQ):
    """Makes a KeyboardInterrupt a block of zeros."""

    def exchange(self, voltages):
        try:
            return super().exchange(voltages)
        except KeyboardInterrupt:
            return np.zeros((self.block, len(self.channels)))


@planted("stop_leaves_the_output_at_zero")
class KeepsItsOutput(VirtualDAQ):
    """Goes on with what it put out before stop."""

    left_v = 0.0

    def _exchange(self, voltages, inputs):
        self.left_v = float(np.abs(voltages).max()) or self.left_v
        super()._exchange(voltages, inputs)
        inputs += self.left_v * np.sin(np.arange(len(inputs)))[:, np.newaxis]
