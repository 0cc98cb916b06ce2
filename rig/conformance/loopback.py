"""The index equation, the latency and the gain, by channels that the output itself is connected to."""

import numpy as np

from rig.conformance.answers import FARTHEST, FILTER_SAMPLES, MEDIAN_TO_RMS, LoopbackRecord, LoopbackSteps
from rig.conformance.subject import TOO_BUSY, has_clock
from rig.errors import DaqOverrun, DaqTimeout, DaqWatchdog

LATE_SAMPLES = 0.25  # as `rig check` allows
LEAST_TAP = 0.05  # of the largest: below it is noise
GAIN_SHARE = 0.05  # of one: what converters are off by, and far below a wrong range
NOT_EXPLAINED = 0.5  # of the amplitude: an output that is missing leaves all of it
RANGE_SHARE = 0.95  # of the range that is declared
SURE = 3.0  # standard errors
FIT_SAMPLES = 4000  # samples that the answer is fitted to; chosen


class LoopbackTests(LoopbackSteps):
    """Tests that see the output."""

    long_run_blocks = 8000
    """Blocks over which every output is looked for: what happens once in 1000 blocks happens eight times."""

    def test_every_output_shows_in_the_loopback_once_and_in_its_order(self) -> None:
        """Of thousands of random outputs none is left out, doubled, or in another's place, and every reading is a number."""
        for recorded in self.record_each_block():
            self._require_order(recorded)
        with self.loopback_running() as daq:
            recorded = self.record(daq, self.signs(self.long_run_blocks * daq.block))
        self._require_order(recorded)

    def test_the_latency_is_that_of_the_loopback(self) -> None:
        """Outputs show neither earlier nor later than ``latency_samples``, and ``skew_samples`` of the channel, say."""
        for recorded in self.record_each_block():
            for column, channel in enumerate(recorded.channels):
                taps = self.answer(recorded, column).taps
                taps = np.where(np.abs(taps) > LEAST_TAP * np.abs(taps).max(), taps, 0.0)
                seen = float(np.arange(taps.size) @ taps / taps.sum())
                said = recorded.latency_samples + channel.skew_samples
                assert abs(seen - said) <= LATE_SAMPLES, (
                    f"block {recorded.block}: an output shows in {channel.name} after {seen:.2f} samples, "
                    f"the driver says {said:g}"
                )

    def test_the_loopback_reads_the_voltage_that_was_handed_over(self) -> None:
        """Gain one with its sign, within 5 %, and nothing beside: a wrong range, sign or column shows here."""
        for recorded in self.record_each_block():
            for column, channel in enumerate(recorded.channels):
                answer = self.answer(recorded, column)
                gain, allowed = float(answer.taps.sum()), GAIN_SHARE + SURE * answer.gain_error
                assert abs(gain - 1.0) <= allowed, (
                    f"block {recorded.block}: channel {channel.name} reads {gain:.3g} times what was handed over: allowed is "
                    f"{1.0 - allowed:.3g} to {1.0 + allowed:.3g}"
                )
                assert abs(answer.offset_v) <= self.tolerance_v, (
                    f"block {recorded.block}: channel {channel.name} reads {answer.offset_v:.3g} V beside what was handed "
                    f"over: allowed is +-{self.tolerance_v:g} V"
                )

    def test_a_restart_begins_with_0_v_in_the_loopback(self) -> None:
        """Driven, stopped and started with 0 V: neither old outputs of the queue nor old readings come back."""
        with self.loopback_running() as daq:
            self.record(daq, np.full((daq.queue_blocks + 2) * daq.block, self.amplitude_v))
            daq.stop()
            daq.start(daq.block)
            recorded = self.record(daq, np.zeros((daq.queue_blocks + 2) * daq.block))
        for first in range(0, len(recorded.read), daq.block):
            read_v = float(np.sqrt(np.nanmean(recorded.read[first : first + daq.block] ** 2, axis=0)).max())
            assert read_v <= NOT_EXPLAINED * self.amplitude_v, (
                f"the loopback reads {read_v:.3g} V RMS from sample {first} on, where nothing but 0 V was handed over"
            )

    def test_voltages_up_to_the_range_are_put_out(self) -> None:
        """Up to 95 % of ``output_range_v``, only where nothing moves: what is not refused is put out as it is."""
        with self.loopback_running() as daq:
            if not daq.capabilities.virtual:
                self.unproven(f"something would move: nothing is driven at more than {self.amplitude_v:g} V")
            ranges = [channel.range_v for channel in daq.channels if channel.loopback]
            level_v = RANGE_SHARE * min(daq.output_range_v, *ranges)
            hold = daq.block * -(-(int(daq.latency_samples) + 4 * FILTER_SAMPLES) // daq.block)
            recorded = self.record(daq, np.repeat([level_v, -level_v], hold))
        for side_v, half in ((level_v, slice(0, hold)), (-level_v, slice(hold, None))):
            there = np.flatnonzero(recorded.usable[half])
            if not (there.size and there[-1] >= hold - FILTER_SAMPLES):
                self.unproven(f"{TOO_BUSY}: outputs came too late")
            read_v = recorded.read[half][there[-1]]
            off_v = np.abs(read_v - side_v)
            assert off_v.max() <= GAIN_SHARE * level_v, (
                f"{side_v:g} V were handed over and {read_v[off_v.argmax()]:.3g} V come out, without an error: "
                f"output_range_v is said to be {daq.output_range_v:g} V"
            )

    def test_after_an_underrun_every_output_has_its_place_again(self) -> None:
        """A host that is late by more than the queue gets outputs that are flagged as held, or an error; then the old order."""
        with self.loopback_running() as daq:
            if not has_clock(daq):
                self.skip("the device waits for the host: nothing comes too late")
            block_s, queue = daq.block / daq.sample_rate_hz, daq.queue_blocks
            before = FIT_SAMPLES // daq.block + 1
            after = 4 * (queue + 4) + (int(daq.latency_samples) + 8 * FILTER_SAMPLES) // daq.block + 40
            outputs = self.signs((before + after) * daq.block)
            try:
                recorded = self.record(daq, outputs, pauses={before: (queue + 4) * block_s})
            except (DaqOverrun, DaqTimeout, DaqWatchdog):
                recorded = None  # the device says so, and ends the run
        if recorded is None:
            with self.loopback() as daq:
                daq.clear()  # what this test has made latch
            return
        if not recorded.usable[-30 * recorded.block :].any():
            self.unproven("the host was late: outputs were held until the end")
        self._require_order(recorded)

    def _require_order(self, recorded: LoopbackRecord) -> None:
        usable = recorded.usable
        for column, channel in enumerate(recorded.channels):
            answer = self.answer(recorded, column, FIT_SAMPLES)
            left = np.abs(answer.left)
            noise_v = MEDIAN_TO_RMS * float(np.nanmedian(left[usable]))
            if FARTHEST * noise_v > self.amplitude_v:
                self.unproven(f"channel {channel.name}: {noise_v:.3g} V RMS of noise hide {self.amplitude_v:g} V")
            wrong = np.flatnonzero(usable & ~(left < max(NOT_EXPLAINED * self.amplitude_v, FARTHEST * noise_v)))
            assert not wrong.size, (
                f"block {recorded.block}: channel {channel.name} differs by {left[wrong[0]]:.3g} V from what was handed over, "
                f"whichever of {answer.taps.size} delays it is given, at {wrong.size} of {usable.sum()} samples, first at "
                f"sample {wrong[0]}"
            )
