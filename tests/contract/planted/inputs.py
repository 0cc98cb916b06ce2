"""Faults of inputs: shape, numbers, scale, order of channels, flags."""

import numpy as np

from rig.daq import LOST
from rig.drivers.virtual import VirtualDAQ
from tests.contract.planted.outputs import GAIN
from tests.contract.planted.table import planted

ROWS = "every_call_returns_one_row_a_sample_and_one_column_a_channel"
KNOWN = "every_channel_reads_what_is_known_of_it"
LOST_ROWS = "lost_samples_are_rows_of_nan_with_their_flag_and_nothing_else_is"


class Answers(VirtualDAQ):
    run_fused = None

    def exchange(self, voltages):
        return self._answer(super().exchange(voltages))

    def _answer(self, inputs):
        return inputs


@planted(ROWS)
class AnswersInSingles(Answers):
    """Inputs are float32."""

    def _answer(self, inputs):
        return inputs.astype(np.float32)


@planted(ROWS)
class AnswersInColumns(Answers):
    """Inputs are [channels, n]."""

    def _answer(self, inputs):
        return inputs.T


@planted(ROWS)
class AnswersOneRowLess(Answers):
    """The last row is missing."""

    def _answer(self, inputs):
        return inputs[:-1]


@planted(ROWS)
class AnswersNothing(VirtualDAQ):
    """All inputs are not a number."""

    def _exchange(self, voltages, inputs):
        inputs[:] = np.nan


@planted("the_voltages_handed_over_are_not_kept")
class LendsItsInputs(VirtualDAQ):
    """Every call returns the same array."""

    lent = None

    def exchange(self, voltages):
        answer = super().exchange(voltages)
        if self.lent is None or self.lent.shape != answer.shape:
            self.lent = answer
        self.lent[:] = answer
        return self.lent


@planted("the_inputs_handed_out_are_not_written_to_again")
class LendsItsInputsInTurn(VirtualDAQ):
    """Returns views of a ring of eight buffers."""

    calls, ring = 0, None

    def exchange(self, voltages):
        answer = super().exchange(voltages)
        if self.ring is None or self.ring.shape[1:] != answer.shape:
            self.ring = np.zeros((8, *answer.shape))
        self.calls += 1
        self.ring[self.calls % 8] = answer
        return self.ring[self.calls % 8]


@planted("the_inputs_handed_out_are_not_written_to_again")
class WritesItsInputsLater(VirtualDAQ):
    """Writes into the inputs of the call before."""

    kept = None

    def _exchange(self, voltages, inputs):
        if self.kept is not None:
            self.kept[:] = 0.0
        super()._exchange(voltages, inputs)
        self.kept = inputs


@planted("every_input_is_filled")
class ForgetsAChannel(VirtualDAQ):
    """The last channel is never filled."""

    def _exchange(self, voltages, inputs):
        measured = np.empty_like(inputs)
        super()._exchange(voltages, measured)
        inputs[:, :-1] = measured[:, :-1]


@planted(GAIN)
class ReadsATenth(VirtualDAQ):
    """Input gain 0.1."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs *= 0.1


@planted(GAIN)
class SwapsLoopbackAndDrive(VirtualDAQ):
    """The columns of loopback and drive are swapped."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[:, [1, -1]] = inputs[:, [-1, 1]]


@planted(KNOWN)
class SwapsForceAndDrive(VirtualDAQ):
    """The columns of force and drive are swapped."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[:, [0, 1]] = inputs[:, [1, 0]]


@planted(KNOWN)
class ForceIsATenth(VirtualDAQ):
    """The force alone reads a tenth."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[:, 0] *= 0.1


@planted(KNOWN)
class AChannelStandsStill(VirtualDAQ):
    """One channel is constant."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[:, 1] = 0.003


@planted("every_block_size_gives_the_same_samples")
class ReadsTheLastOutput(VirtualDAQ):
    """Every input is the last output of the block."""

    def _exchange(self, voltages, inputs):
        inputs[:] = voltages[-1]


@planted("a_repeatable_device_repeats_itself")
class SaysItRepeatsItself(VirtualDAQ):
    """Says that it is repeatable, and is not."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs += 1e-4 * np.random.default_rng().standard_normal(inputs.shape)


@planted(LOST_ROWS)
class MakesUpLostSamples(VirtualDAQ):
    """Rows are not a number, without the flag of lost samples."""

    run_fused = None

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[-1] = np.nan


@planted(LOST_ROWS)
class FillsLostSamples(VirtualDAQ):
    """Lost samples are flagged, and filled with zeros."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[-1], self.flags[-1] = 0.0, LOST


@planted(LOST_ROWS)
class DoesNotCountLostSamples(VirtualDAQ):
    """Lost samples are flagged, and not counted."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs[-1], self.flags[-1] = np.nan, LOST


@planted("every_output_shows_in_the_loopback_once_and_in_its_order")
class SeldomNotANumber(VirtualDAQ):
    """One row in 5000 is not a number, without a flag."""

    rows = 0

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.rows += len(inputs)
        if self.rows >= 5000:
            inputs[0], self.rows = np.nan, 0


@planted("a_restart_begins_with_0_v_in_the_loopback")
class BeginsWithOldInputs(VirtualDAQ):
    """The first block after a restart is the last one before it."""

    last = None

    def _start(self):
        super()._start()
        self.is_first = True

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        if self.is_first and self.last is not None and self.last.shape == inputs.shape:
            inputs[:] = self.last
        self.is_first, self.last = False, inputs.copy()
