"""Faults of outputs and latency: size, sign, order, delay."""

import numpy as np

from rig.bench import DriverChoice
from rig.drivers.virtual import VirtualDAQ
from tests.contract.planted.drivers import PacedDAQ
from tests.contract.planted.table import planted

ORDER = "every_output_shows_in_the_loopback_once_and_in_its_order"
GAIN = "the_loopback_reads_the_voltage_that_was_handed_over"
LATENCY = "the_latency_is_that_of_the_loopback"


class ScalesItsOutput(VirtualDAQ):
    gain = 1.0

    def _exchange(self, voltages, inputs):
        super()._exchange(self.gain * voltages, inputs)


@planted(GAIN)
class DoublesItsOutput(ScalesItsOutput):
    """Output times 2."""

    gain = 2.0


@planted(GAIN)
class HalvesItsOutput(ScalesItsOutput):
    """Output times 0.5."""

    gain = 0.5


@planted(GAIN)
class InvertsItsOutput(ScalesItsOutput):
    """Output times -1."""

    gain = -1.0


@planted(GAIN)
class OutputIsSomeTooLarge(ScalesItsOutput):
    """Output times 1.1."""

    gain = 1.1


@planted("a_witness_sees_the_voltage_that_was_handed_over")
class HidesItsGain(ScalesItsOutput):
    """Output times 2, and inputs times 0.5: the loopback looks right."""

    gain = 2.0

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        inputs *= 0.5


@planted(GAIN)
class AddsToItsOutput(VirtualDAQ):
    """0.04 V are added to every output."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages + 0.04, inputs)


@planted(ORDER)
class AddsALot(VirtualDAQ):
    """Every output is rounded to 0.1 V."""

    def _exchange(self, voltages, inputs):
        super()._exchange(np.round(voltages + 1e-9, 1), inputs)


@planted("voltages_up_to_the_range_are_put_out")
class ClipsAtHalfTheRange(VirtualDAQ):
    """Outputs are clipped at half the range, without an error."""

    def _exchange(self, voltages, inputs):
        half = 0.5 * self.output_range_v
        super()._exchange(np.clip(voltages, -half, half), inputs)


@planted(LATENCY)
class ShiftsItsOutputs(VirtualDAQ):
    """Outputs are late by a sample, across the blocks."""

    last_v = 0.0

    def _exchange(self, voltages, inputs):
        shifted = np.concatenate([[self.last_v], voltages[:-1]])
        self.last_v = voltages[-1]
        super()._exchange(shifted, inputs)


@planted(LATENCY)
class IsABlockLate(PacedDAQ):
    """Outputs are put out a block later than the latency says."""

    def _start(self):
        super()._start()
        self.kept_v = np.zeros(self.block)

    def _exchange(self, voltages, inputs):
        kept_v, self.kept_v = self.kept_v, voltages.copy()
        super()._exchange(kept_v, inputs)


@planted(LATENCY)
class SaysNoLatency(VirtualDAQ):
    """Says that it has no latency."""

    latency_samples = 0.0
    filter_delay_samples = 0.0


@planted("the_latency_is_known_and_not_negative")
class ChangesItsLatency(VirtualDAQ):
    """The latency changes while it runs."""

    @property
    def latency_samples(self):
        return super().latency_samples + float(self._first > 20)


@planted("an_output_shows_once_its_latency_is_over")
class SaysNoQueue(VirtualDAQ):
    """Says that it has no queue; no loopback is needed."""

    def __init__(self, bench, seed=0):
        options = {**bench.driver.options, "queue_blocks": 1}
        super().__init__(bench.model_copy(update={"driver": DriverChoice(name="virtual", options=options)}), seed)

    @property
    def latency_samples(self):
        return super().latency_samples - self.block


class Boastful(VirtualDAQ):
    latency_samples = 8.5
    filter_delay_samples = 0.0


@planted("an_output_does_not_show_before_its_latency")
class SaysMoreLatency(Boastful):
    """Says a latency of 8.5 samples and has half a sample; no loopback is needed."""


@planted("an_output_does_not_show_before_its_latency")
class SaysMoreLatencyWithFilters(Boastful):
    """The same, and puts a part of it down to filters."""

    filter_delay_samples = 5.0


@planted("the_latency_is_known_and_not_negative")
class SaysTooMuchFilter(Boastful):
    """Says that its filters are later than the whole device."""

    filter_delay_samples = 9.0


@planted(ORDER)
class LosesABlock(VirtualDAQ):
    """One block of outputs in 30 is lost."""

    calls = 0

    def _exchange(self, voltages, inputs):
        self.calls += 1
        super()._exchange(np.zeros_like(voltages) if self.calls % 30 == 0 else voltages, inputs)


class SeldomWrong(VirtualDAQ):
    calls = 0
    every = 1000

    def _start(self):
        super()._start()
        self.last_v, self.last_inputs = np.zeros(self.block), np.zeros((self.block, len(self.channels)))

    def _exchange(self, voltages, inputs):
        self.calls += 1
        if self.calls % self.every:
            super()._exchange(voltages, inputs)
        else:
            self._go_wrong(voltages, inputs)
        self.last_v, self.last_inputs = voltages.copy(), inputs.copy()

    def _go_wrong(self, voltages, inputs):
        raise NotImplementedError


@planted(ORDER)
class DoublesABlockOfOutputs(SeldomWrong):
    """One block of outputs in 1000 is the block before it."""

    def _go_wrong(self, voltages, inputs):
        super(SeldomWrong, self)._exchange(self.last_v, inputs)


@planted(ORDER)
class DoublesABlockOfInputs(SeldomWrong):
    """One block of inputs in 1000 is the block before it."""

    def _go_wrong(self, voltages, inputs):
        super(SeldomWrong, self)._exchange(voltages, inputs)
        inputs[:] = self.last_inputs


@planted(ORDER)
class SwapsTwoOutputs(SeldomWrong):
    """The outputs of one block in 1000 are in the wrong order."""

    def _go_wrong(self, voltages, inputs):
        super(SeldomWrong, self)._exchange(voltages[::-1].copy(), inputs)


@planted(ORDER)
class LosesASample(SeldomWrong):
    """One sample in 2000 is lost without a flag."""

    @property
    def every(self):
        return max(1, 2000 // max(1, self.block))

    def _go_wrong(self, voltages, inputs):
        super(SeldomWrong, self)._exchange(voltages, inputs)
        next_one = np.zeros((1, len(self.channels)))
        flags, self.flags = self.flags, self.flags[:1]
        super(SeldomWrong, self)._exchange(voltages[-1:], next_one)
        self.flags = flags
        inputs[:] = np.vstack([inputs[1:], next_one])


@planted("the_voltages_handed_over_are_left_as_they_are")
class WritesIntoTheVoltages(VirtualDAQ):
    """Writes into the caller's voltages."""

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        voltages *= 0.5


class Lingers(PacedDAQ):
    """What it has made late once, it makes late ever after."""

    is_off = False

    def _take(self, voltages, inputs, late):
        self.is_off = self.is_off or late
        if self.is_off:
            self._linger(voltages, inputs, late)
        else:
            super()._take(voltages, inputs, late)
        self.before, self.inputs_before = voltages.copy(), inputs.copy()

    def _linger(self, voltages, inputs, late):
        raise NotImplementedError


@planted("after_an_underrun_every_output_has_its_place_again")
class IsABlockLateAfterAnUnderrun(Lingers):
    """Outputs are off by a block after an underrun."""

    def _linger(self, voltages, inputs, late):
        PacedDAQ._take(self, self.before, inputs, late)


@planted("after_an_underrun_every_output_has_its_place_again")
class ReadsABlockLateAfterAnUnderrun(Lingers):
    """Inputs are off by a block after an underrun."""

    def _linger(self, voltages, inputs, late):
        fresh = np.empty_like(inputs)
        PacedDAQ._take(self, voltages, fresh, late)
        inputs[:], self.kept = getattr(self, "kept", self.inputs_before), fresh


@planted("after_an_underrun_every_output_has_its_place_again")
class HoldsWithoutAFlag(PacedDAQ):
    """Outputs that come too late are replaced by the one before them, without a flag."""

    def _take(self, voltages, inputs, late):
        super()._take(voltages, inputs, late)
        self.flags[:] = 0
