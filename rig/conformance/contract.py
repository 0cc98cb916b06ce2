"""The DAQ contract as tests: what every driver has to pass before a rig is trusted to it.

Derive a test class from `DriverContract` and say how a driver is made; pytest collects the rest::

    class TestMyDriver(DriverContract):
        def make(self):
            return MyDriver(bench)

Tests that a driver cannot take part in by its `rig.daq.Capabilities` say so instead of passing in silence.
Outputs stay within ``amplitude_v``; nothing is driven at more than that.
"""

import math
from functools import partial

import numpy as np

from rig.conformance.loopback import LoopbackTests
from rig.conformance.timing import TimingTests
from rig.conformance.ways_out import WaysOutTests
from rig.daq import DAQ, LOST, State
from rig.errors import DaqError, DaqRefused

__all__ = ["DriverContract"]


class DriverContract(LoopbackTests, WaysOutTests, TimingTests):
    """Tests of one driver. Override `make`; and ``amplitude_v``, ``tolerance_v`` for a physical bench."""

    answer_samples = 2
    """Samples after the latency within which a repeatable device has begun to answer."""

    def test_nothing_is_opened_by_the_constructor(self) -> None:
        """A driver that was made and thrown away leaves no trace."""
        assert self.make().state is State.CLOSED

    def test_the_life_cycle_is_open_start_stop_close(self) -> None:
        """Every step leads to its state."""
        daq = self.make()
        steps = [
            (daq.open, State.OPEN),
            (daq.start, State.RUNNING),
            (daq.stop, State.OPEN),
            (daq.close, State.CLOSED),
        ]
        try:
            for step, state in steps:
                step()
                assert daq.state is state
        finally:
            daq.close()

    def test_close_may_be_called_at_any_time_and_again(self) -> None:
        """Before opening, while running, twice."""
        daq = self.make()
        daq.close()
        daq.open()
        daq.start(1)
        daq.close()
        daq.close()
        assert daq.state is State.CLOSED

    def test_a_driver_may_be_opened_again(self) -> None:
        """After close, the same object works once more."""
        daq = self.make()
        for _ in range(2):
            with daq:
                daq.start(1)
                assert np.isfinite(daq.exchange(np.zeros(1))).all()

    def test_an_error_inside_the_context_closes(self) -> None:
        """Whatever happens, the device is let go of."""
        daq = self.make()
        try:
            with daq:
                daq.start(1)
                raise KeyError("anything")
        except KeyError:
            pass
        assert daq.state is State.CLOSED

    def test_steps_out_of_order_are_refused(self) -> None:
        """Exchange before start, start before open, open twice, start twice."""
        daq = self.make()
        assert "closed" in self.refused(lambda: daq.exchange(np.zeros(1)))
        assert "closed" in self.refused(lambda: daq.start(1))
        with daq:
            self.refused(daq.open)
            assert "open" in self.refused(lambda: daq.exchange(np.zeros(1)))
            daq.start(1)
            self.refused(lambda: daq.start(1))

    def test_blocks_beyond_the_device_are_refused_with_what_is_allowed(self) -> None:
        """0, and one more than the largest."""
        with self.make() as daq:
            largest = daq.capabilities.largest_block
            for block in (0, -1, largest + 1):
                assert str(largest) in self.refused(partial(daq.start, block))

    def test_every_call_returns_one_row_a_sample_and_one_column_a_channel(self) -> None:
        """In volts, finite, float64."""
        for block in self.blocks:
            with self.running(block) as daq:
                inputs = daq.exchange(np.zeros(block))
                assert inputs.shape == (block, len(daq.channels))
                assert inputs.dtype == np.float64
                assert np.isfinite(inputs).all()

    def test_a_block_of_another_size_is_refused(self) -> None:
        """N is fixed at start."""
        with self.running(4) as daq:
            self.refused(lambda: daq.exchange(np.zeros(3)))
            self.refused(lambda: daq.exchange(np.zeros((4, 1))))

    def test_voltages_beyond_the_range_or_not_a_number_are_refused(self) -> None:
        """The message names the voltage and the range; the device goes on."""
        with self.running(2) as daq:
            too_much = 1.5 * daq.output_range_v
            assert f"{daq.output_range_v:g}" in self.refused(lambda: daq.exchange(np.array([0.0, too_much])))
            self.refused(lambda: daq.exchange(np.array([np.nan, 0.0])))
            self.refused(lambda: daq.exchange(np.array([0.0, -np.inf])))
            daq.exchange(np.zeros(2))

    def test_the_voltages_handed_over_are_not_kept(self) -> None:
        """The caller may write its next block into the same array."""
        with self.running(4) as daq:
            voltages = np.zeros(4)
            first = daq.exchange(voltages)
            kept = first.copy()
            voltages[:] = self.amplitude_v
            daq.exchange(voltages)
            np.testing.assert_array_equal(first, kept)

    def test_the_voltages_handed_over_are_left_as_they_are(self) -> None:
        """They are the caller's, who may hand them over again."""
        with self.running(4) as daq:
            voltages = np.linspace(-self.amplitude_v, self.amplitude_v, 4)
            kept = voltages.copy()
            for _ in range(3):
                daq.exchange(voltages)
                np.testing.assert_array_equal(voltages, kept)

    def test_the_latency_is_known_and_not_negative(self) -> None:
        """u[i] cannot show before y[i], and filters are part of the latency."""
        for block in self.blocks:
            with self.running(block) as daq:
                assert 0.0 <= daq.filter_delay_samples <= daq.latency_samples

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
            steps = int(daq.sample_rate_hz * 0.02) // block + 1
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

    def test_every_block_size_gives_the_same_samples(self) -> None:
        """Open loop, a repeatable device whose latency does not depend on the block answers the same voltages alike."""
        answers, latencies = [], []
        for block in self.blocks:
            with self.make() as daq:
                if not daq.capabilities.repeatable:
                    self.skip("the device does not repeat itself")
                daq.start(block)
                latencies.append(daq.latency_samples)
                voltages = self.sine(400, daq.sample_rate_hz)
                answers.append(np.vstack([daq.exchange(v.copy()) for v in voltages.reshape(-1, block)]))
        if len(set(latencies)) > 1:
            self.skip("the device has a queue, whose length in samples depends on the block")
        for answer in answers[1:]:
            np.testing.assert_array_equal(answer, answers[0])

    def test_stop_leaves_the_output_at_zero(self) -> None:
        """Driven, stopped at its largest output and started again with 0 V, the inputs come to rest."""
        with self.running(10) as daq:
            blocks = round(8.25 * daq.sample_rate_hz / 20.0) // 10  # to the top of the ninth period: what is kept shows
            for voltages in self.sine(10 * blocks, daq.sample_rate_hz).reshape(-1, 10):
                daq.exchange(voltages.copy())
            daq.stop()
            daq.start(10)
            inputs = np.vstack([daq.exchange(np.zeros(10)) for _ in range(500)])
            assert np.std(inputs[-1000:], axis=0).max() < self.tolerance_v

    def test_lost_samples_are_rows_of_nan_with_their_flag_and_nothing_else_is(self) -> None:
        """Flags uint16[n]; a row is either lost, all NaN and flagged, or there."""
        for block in self.blocks:
            with self.running(block) as daq:
                for _ in range(20):
                    inputs = daq.exchange(np.zeros(block))
                    assert daq.flags.shape == (block,)
                    assert daq.flags.dtype == np.uint16
                    lost = (daq.flags & LOST) != 0
                    assert np.isnan(inputs[lost]).all()
                    assert np.isfinite(inputs[~lost]).all()

    def test_the_device_says_who_it_is_in_words(self) -> None:
        """Identity in text, statistics in numbers, remarks in lines, all known once open."""
        with self.make() as daq:
            for name, value in daq.identity.items():
                assert isinstance(name, str)
                assert isinstance(value, str)
            assert all(isinstance(value, int | float) for value in daq.statistics.values())
            assert all(isinstance(remark, str) and "\n" not in remark for remark in daq.remarks)

    def test_capabilities_are_the_same_before_and_while_running(self) -> None:
        """Whether something physical moves is known before anything is started."""
        with self.make() as daq:
            before = daq.capabilities
            daq.start(1)
            daq.exchange(np.zeros(1))
            assert daq.capabilities == before

    def test_a_device_that_is_gone_is_a_daq_error_and_can_be_closed(self) -> None:
        """`unplug` takes the device away: exchange raises a `DaqError` that says something, close does not."""
        daq = self.make()
        try:
            daq.open()
            daq.start(1)
            if not self.unplug(daq):
                self.skip("the contract has not been told how this device is unplugged (override unplug)")
            message = ""
            try:
                for _ in range(1000):
                    daq.exchange(np.zeros(1))
            except DaqError as error:
                message = str(error)
            assert message, "exchange went on without a device, or failed without a word"
        finally:
            daq.close()
        assert daq.state is State.CLOSED

    def test_closed_after_a_refusal_a_driver_can_be_used_again(self) -> None:
        """A mistake of the host's leaves nothing behind."""
        daq = self.make()
        try:
            with daq:
                daq.start(1)
                daq.exchange(np.zeros(7))
        except DaqRefused:
            pass
        assert daq.state is State.CLOSED
        with daq:
            daq.start(1)
            assert daq.exchange(np.zeros(1)).shape == (1, len(daq.channels))

    def test_counters_are_whole_numbers_that_only_grow(self) -> None:
        """Whatever a driver counts."""
        with self.running(10) as daq:
            before = dict(daq.counters)
            for _ in range(20):
                daq.exchange(np.zeros(10))
            for name, count in daq.counters.items():
                assert isinstance(count, int)
                assert count >= before.get(name, 0)
