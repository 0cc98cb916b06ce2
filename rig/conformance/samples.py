"""Tests of the blocks: their shape, their numbers, what is lost of them, and how they answer."""

import math

import numpy as np

from rig.conformance.subject import TOO_BUSY, DriverUnderTest
from rig.daq import DAQ, HELD, LOST

KEPT_BLOCKS = 50  # blocks whose inputs are compared later; chosen
KNOWN_SAMPLES = 2000  # samples that are compared with known ones; chosen
KNOWN_SHARE = 0.05  # of what is known, RMS
LARGEST_LAG = 100  # samples of delay behind the queue that are searched; chosen
LEAST_V = 1e-9  # RMS that is taken for something
REPEATED_SAMPLES = 400  # samples of a run that is repeated; chosen


class SamplesTests(DriverUnderTest):
    """Tests of what is swapped."""

    answer_samples = 2
    """Samples after the latency within which a repeatable device has begun to answer."""

    def test_every_call_returns_one_row_a_sample_and_one_column_a_channel(self) -> None:
        """In volts, finite, float64."""
        for block in self.blocks:
            with self.running(block) as daq:
                inputs = daq.exchange(np.zeros(daq.block))
                wanted = daq.block, len(daq.channels)
                assert inputs.shape == wanted, f"inputs are of shape {inputs.shape}: allowed is {wanted}"
                assert inputs.dtype == np.float64, f"inputs are {inputs.dtype}: allowed is float64"
                assert np.isfinite(inputs).all(), f"block {daq.block}: inputs of the first block are not finite"

    def test_every_input_is_filled(self) -> None:
        """Whatever the driver is handed: no number in ``inputs`` is one that was there before."""
        for block in self.blocks:
            with self.running(block) as daq:
                voltages = np.zeros(daq.block)
                for before in (np.nan, 1e30):
                    inputs = np.full((daq.block, len(daq.channels)), before)
                    daq._exchange(voltages, inputs)
                    there = (daq.flags & LOST) == 0
                    forgotten = np.isnan(inputs[there]) | (inputs[there] == before)
                    assert not forgotten.any(), (
                        f"block {daq.block}: channel {daq.channels[int(forgotten.any(axis=0).argmax())].name} is not filled"
                    )

    def test_the_voltages_handed_over_are_not_kept(self) -> None:
        """The caller may write its next block into the same array."""
        with self.running(4) as daq:
            voltages = np.zeros(daq.block)
            first = daq.exchange(voltages)
            kept = first.copy()
            voltages[:] = self.amplitude_v
            daq.exchange(voltages)
            assert np.array_equal(first, kept, equal_nan=True), "the inputs of a call have changed at the next call"

    def test_the_inputs_handed_out_are_not_written_to_again(self) -> None:
        """The caller may keep them: no array is handed out twice, and none changes later."""
        with self.running(4) as daq:
            answers, copies = [], []
            for number in range(KEPT_BLOCKS):
                answers.append(daq.exchange(np.full(daq.block, (-1) ** number * self.amplitude_v)))
                copies.append(answers[-1].copy())
            for number, (answer, copy) in enumerate(zip(answers, copies, strict=True)):
                assert np.array_equal(answer, copy, equal_nan=True), (
                    f"the inputs of call {number} have changed within {KEPT_BLOCKS - number} calls after it"
                )

    def test_the_voltages_handed_over_are_left_as_they_are(self) -> None:
        """They are the caller's, who may hand them over again."""
        with self.running(4) as daq:
            voltages = np.linspace(-self.amplitude_v, self.amplitude_v, daq.block)
            kept = voltages.copy()
            for _ in range(3):
                daq.exchange(voltages)
                assert np.array_equal(voltages, kept), "the driver has written into the voltages that it was handed"

    def test_the_latency_is_known_and_not_negative(self) -> None:
        """u[i] cannot show before y[i], filters are part of the latency, and it stays what it was at start."""
        for block in self.blocks:
            with self.running(block) as daq:
                said = daq.latency_samples, daq.filter_delay_samples
                assert 0.0 <= said[1] <= said[0], (
                    f"filter_delay_samples = {said[1]:g}: allowed is 0 to latency_samples = {said[0]:g}"
                )
                for _ in range(KEPT_BLOCKS):
                    daq.exchange(np.zeros(daq.block))
                assert (daq.latency_samples, daq.filter_delay_samples) == said, (
                    f"latency and filter delay were {said[0]:g} and {said[1]:g} samples at start, and are "
                    f"{daq.latency_samples:g} and {daq.filter_delay_samples:g}"
                )

    def test_an_output_does_not_show_before_its_latency(self) -> None:
        """A repeatable device does not answer a step before its latency.

        Of the latency the delay of filters is left out: they begin to answer at once and are late on the average.
        """
        for block in self.blocks:
            first, latency, filter_delay = self._first_answer(block)
            assert first >= int(latency - filter_delay), f"block {block}: shows {first} samples later"

    def test_an_output_shows_once_its_latency_is_over(self) -> None:
        """A repeatable device answers a step within its latency and the few samples that a rig takes to move."""
        for block in self.blocks:
            first, latency, _ = self._first_answer(block)
            assert first <= math.ceil(latency) + self.answer_samples, (
                f"block {block}: the first answer comes after {first} samples, the latency is said to be {latency:g}"
            )

    def _first_answer(self, block: int) -> tuple[int, float, float]:
        """Index of the first reading that a step changes; latency and filter delay as the driver says."""
        with self.make() as daq:
            if not daq.capabilities.repeatable:
                self.skip("the device does not repeat itself, so that two runs cannot be compared")
            block = min(block, daq.capabilities.largest_block)
            daq.start(block)
            steps = int(daq.sample_rate_hz * 0.02 + daq.latency_samples) // block + 1
            daq.stop()
            quiet, driven = (self._answer(daq, block, steps, level) for level in (0.0, self.amplitude_v))
            daq.start(block)
            changed = np.flatnonzero((quiet != driven).any(axis=1))
            assert changed.size, f"nothing answers a step of {self.amplitude_v:g} V within {steps * block} samples"
            return int(changed[0]), daq.latency_samples, daq.filter_delay_samples

    def _answer(self, daq: DAQ, block: int, calls: int, level: float) -> np.ndarray:
        daq.start(block)
        voltages = np.full(block, level)
        inputs = np.vstack([daq.exchange(voltages) for _ in range(calls)])
        daq.stop()
        return inputs

    def test_a_repeatable_device_repeats_itself(self) -> None:
        """Two runs with the same outputs return the same inputs."""
        answers = [self._answers(max(self.blocks), self.sine(REPEATED_SAMPLES, 1000.0))[0] for _ in range(2)]
        differ = int((answers[0] != answers[1]).sum())
        assert not differ, f"two runs with the same outputs differ in {differ} of {answers[0].size} readings"

    def test_every_block_size_gives_the_same_samples(self) -> None:
        """Open loop, a repeatable device whose latency does not depend on the block answers the same voltages alike."""
        runs = [self._answers(block, self.sine(REPEATED_SAMPLES, 1000.0)) for block in self.blocks]
        if len({latency for _, latency in runs}) > 1:
            self.skip("the device has a queue, whose length in samples depends on the block")
        for block, (answer, _) in zip(self.blocks[1:], runs[1:], strict=True):
            rows = min(len(answer), len(runs[0][0]))
            differ = int((answer[:rows] != runs[0][0][:rows]).sum())
            assert not differ, (
                f"in blocks of {block} samples {differ} of {answer.size} readings differ from those in blocks of "
                f"{self.blocks[0]}"
            )

    def test_every_channel_reads_what_is_known_of_it(self) -> None:
        """Each within 5 %: a wrong gain, two columns that are swapped, or a channel that stands still show here."""
        block, outputs = max(self.blocks), self.signs(KNOWN_SAMPLES)
        known = self.known_inputs(outputs, block)
        if known is None:
            self.unproven(
                "nothing tells what the channels without a loopback should read, so that their gain and order is open: "
                "connect the output to each of them in turn, with loopback = true, or override known_inputs"
            )
        with self.running(block) as daq:
            whole = outputs[: outputs.size // daq.block * daq.block].reshape(-1, daq.block)
            read = np.vstack([daq.exchange(part.copy()) for part in whole])
            names = [channel.name for channel in daq.channels]
            if daq.counters.get(HELD, 0):
                self.unproven(f"{TOO_BUSY}: outputs came too late")
        lags = range(min(daq.queue_samples + LARGEST_LAG, len(read) // 2))  # the latency is for other tests to judge
        off = min((_off(read[lag:], known[: len(read) - lag]) for lag in lags), key=np.sum)
        for name, share in zip(names, off, strict=True):
            assert share <= KNOWN_SHARE, (
                f"channel {name} is {100.0 * share:.3g} % RMS off what it is known to read: allowed is "
                f"{100.0 * KNOWN_SHARE:g} %"
            )

    def _answers(self, block: int, voltages: np.ndarray) -> tuple[np.ndarray, float]:
        """What a repeatable device answers in blocks of a size, and its latency."""
        with self.running(block) as daq:
            if not daq.capabilities.repeatable:
                self.skip("the device does not repeat itself")
            whole = voltages[: voltages.size // daq.block * daq.block].reshape(-1, daq.block)
            return np.vstack([daq.exchange(part.copy()) for part in whole]), daq.latency_samples

    def test_stop_leaves_the_output_at_zero(self) -> None:
        """Driven, stopped at its largest output and started again with 0 V, the inputs come to rest."""
        with self.running(max(self.blocks)) as daq:
            block = daq.block
            blocks = (
                round(8.25 * daq.sample_rate_hz / 20.0) // block
            )  # to the top of the ninth period: what is kept shows
            for voltages in self.sine(block * blocks, daq.sample_rate_hz).reshape(-1, block):
                daq.exchange(voltages.copy())
            daq.stop()
            daq.start(block)
            inputs = np.vstack([daq.exchange(np.zeros(block)) for _ in range(-(-5000 // block))])
            rest_v = float(np.nanstd(inputs[-1000:], axis=0).max())  # a busy computer may have lost samples
            assert rest_v < self.tolerance_v, (
                f"at 0 V the inputs are at {rest_v:.3g} V RMS: allowed is {self.tolerance_v:g} V"
            )

    def test_lost_samples_are_rows_of_nan_with_their_flag_and_nothing_else_is(self) -> None:
        """Flags uint16[n]; a row is either lost, all NaN, flagged and counted, or there."""
        for block in self.blocks:
            with self.running(block) as daq:
                for _ in range(20):
                    counted = sum(daq.counters.values())
                    inputs = daq.exchange(np.zeros(daq.block))
                    said = f"{daq.flags.dtype} {daq.flags.shape}"
                    assert said == f"uint16 ({daq.block},)", f"flags are {said}: allowed is uint16 ({daq.block},)"
                    lost = (daq.flags & LOST) != 0
                    assert np.isnan(inputs[lost]).all(), "a row that is flagged as lost is not NaN"
                    assert np.isfinite(inputs[~lost]).all(), "a row that is not flagged as lost is not finite"
                    assert not lost.any() or sum(daq.counters.values()) > counted, "lost samples are not counted"

    def test_counters_are_whole_numbers_that_only_grow(self) -> None:
        """Whatever a driver counts."""
        with self.running(max(self.blocks)) as daq:
            before = dict(daq.counters)
            for _ in range(20):
                daq.exchange(np.zeros(daq.block))
            for name, count in daq.counters.items():
                assert isinstance(count, int), f"counters: {name} = {count!r} is not a whole number"
                assert count >= before.get(name, 0), f"counters: {name} was {before[name]} and is {count}"


def _off(read: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Difference of each channel from what is known, RMS, as a share of it."""
    known_v = np.maximum(LEAST_V, np.sqrt(np.nanmean(known**2, axis=0)))
    return np.asarray(np.sqrt(np.nanmean((read - known) ** 2, axis=0)) / known_v)
