"""A chassis without a clock: the two tasks of a device as the buffer thread sees them, sampled where a test says so.

An output is put out at the sample of the same index as the input that measures it. Without outputs the device stops.
"""

import threading

import numpy as np
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError, DaqReadError, DaqWriteError

from rig.drivers.nidaqmx.library import as_ni_error

PATIENCE_S = 10.0


class Chassis:
    """Inputs are the output times their gain. ``ahead``: blocks of 0 V in the output buffer at the start."""

    def __init__(self, block, ahead, gains=(1.0, -0.5)):
        self.block, self.gains = block, np.array(gains)[:, None]
        self.written = [np.zeros(block)] * ahead
        self.measured = self.awaited = 0
        self.allowed = 0
        self.is_started = False
        self.stopped_at = None
        self.faults = {}
        self.is_over = lambda: False
        self.lockstep = False
        self._changed = threading.Condition()

    # What the buffer thread calls

    def start(self):
        self._fail("start")
        self.is_started = True

    def read(self, inputs):
        with self._changed:
            self.awaited += 1
            self._changed.notify_all()
            if not self._changed.wait_for(lambda: self.allowed > self.measured or "read" in self.faults, PATIENCE_S):
                raise as_ni_error(DaqReadError("no samples", DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE, 0), "ai0")
            self._fail("read")
            inputs[:] = self.gains * self.written[self.measured]
            self.measured += 1
            self._changed.notify_all()

    def write(self, volts):
        with self._changed:
            self._fail("write")
            if self.stopped_at is not None:
                code = DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES
                raise as_ni_error(DaqWriteError("generation has stopped", code, 0), "ao0")
            self.written += list(volts.reshape(-1, self.block).copy())
            self._changed.notify_all()

    def generated(self):
        return min(self.measured, len(self.written)) * self.block

    # What happens on it

    def sample(self, blocks=1):
        """Let the device sample some blocks, and wait until the thread awaits the next one after each."""
        for _ in range(blocks):
            with self._changed:
                if self.allowed >= len(self.written):
                    self.stopped_at = self.allowed
                    return
                self.allowed += 1
                self._changed.notify_all()
                while not (self._answered() or self.faults or self.is_over()):
                    self._changed.wait(0.01)

    def _answered(self):
        """Whether the thread has done what it does after the last block of inputs; in lockstep it waits for the loop."""
        return self.measured >= self.allowed if self.lockstep else self.awaited > self.allowed

    def run_dry(self):
        """The device goes on while the thread is not scheduled: its buffer runs dry."""
        with self._changed:
            self.stopped_at = len(self.written)

    def break_(self, call, code, message="it is broken"):
        """Let a call end with an error of NI from now on."""
        kind = {"read": DaqReadError, "write": DaqWriteError}.get(call)
        error = kind(message, code, 0) if kind else DaqError(message, code)
        with self._changed:
            self.faults[call] = error
            self._changed.notify_all()

    def _fail(self, call):
        if call in self.faults:
            raise as_ni_error(self.faults[call], "ai0" if call == "read" else "ao0")

    @property
    def put_out(self):
        """Everything that was written [n], V."""
        return np.concatenate(self.written)
