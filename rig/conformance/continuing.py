"""Tests of devices that go on with the last period of outputs when the next ones come too late."""

import math

import numpy as np

from rig.conformance.answers import FARTHEST, MEDIAN_TO_RMS, Answer, LoopbackRecord, LoopbackSteps, delays_of
from rig.conformance.looking import STILL, OutputSteps
from rig.conformance.subject import has_clock
from rig.daq import DAQ
from rig.errors import DaqWatchdog

PERIOD = 12.4
"""Samples: no whole number, and few, so that a copy of a copy shows after a while."""
OFF_SHARE = 0.1  # of the amplitude: the cut of a peak between two samples takes 3 %, the cubic 0.2 %
FIT_SAMPLES = 2000  # samples of random output that the answer is fitted to; chosen
FIRST_BLOCKS = 20  # blocks of 0 V before anything is driven; chosen
SINE_BLOCKS = 60  # blocks of the sine about the pause; chosen
PAUSE_SHARE = 0.5  # of the watchdog


class ContinuingTests(LoopbackSteps, OutputSteps):
    """Tests of a late host, for devices that say in ``identity`` that they go on with a ``longest_period``."""

    def test_late_outputs_are_continued_with_the_last_period(self) -> None:
        """A host that is late leaves a sine a sine, and the loopback reads what the driver says was put out."""
        with self.loopback_running() as daq:
            pause_s = self._pause_s(daq, PERIOD)
            samples = max(FIT_SAMPLES, 4 * delays_of(daq.latency_samples, daq.block))
            fit = FIRST_BLOCKS + math.ceil(samples / daq.block)
            blocks = fit + SINE_BLOCKS + math.ceil(pause_s * daq.sample_rate_hz / daq.block)
            outputs = self.amplitude_v * np.sin(2.0 * np.pi / PERIOD * np.arange(blocks * daq.block))
            outputs[: fit * daq.block] = self.signs(fit * daq.block)
            outputs[: FIRST_BLOCKS * daq.block] = 0.0  # those that are late after the start are flagged by nobody
            periods = np.where(np.arange(blocks) >= fit, PERIOD, 0.0)
            recorded = self.record(daq, outputs, {fit + SINE_BLOCKS // 2: pause_s}, periods)
        if not recorded.held.any():
            self.unproven("the host was not late enough: nothing was missing")
        assert recorded.continued.any(), (
            "outputs came too late and were held: the device says that it goes on with them"
        )
        off_v = np.abs(recorded.as_put_out - outputs)[recorded.handed_over(recorded.continued)]
        assert off_v.max() <= OFF_SHARE * self.amplitude_v, (
            f"a sine with a period of {PERIOD:g} samples is off by {off_v.max():.3g} V where it is continued: allowed is "
            f"{OFF_SHARE * self.amplitude_v:.3g} V"
        )
        self._require_what_was_put_out(recorded, fit * recorded.block)

    def _require_what_was_put_out(self, recorded: LoopbackRecord, fit: int) -> None:
        known = recorded._replace(outputs=recorded.as_put_out, held=np.zeros_like(recorded.held))
        for column, channel in enumerate(recorded.channels):
            left = np.abs(Answer.of(known, column, fit).left)[~recorded.lost]
            allowed_v = OFF_SHARE * self.amplitude_v + FARTHEST * MEDIAN_TO_RMS * float(np.nanmedian(left[:fit]))
            if allowed_v > self.amplitude_v:
                self.unproven(f"channel {channel.name}: noise hides {self.amplitude_v:g} V")
            assert np.nanmax(left) <= allowed_v, (
                f"channel {channel.name} differs by {np.nanmax(left):.3g} V from what the driver says was put out: allowed "
                f"is {allowed_v:.3g} V"
            )

    def test_nothing_is_continued_before_a_period_has_come(self) -> None:
        """Half a period after the start there is nothing to go on with: outputs that come too late are held."""
        with self.loopback_running() as daq:
            period = 40.0 * daq.block + 0.4
            pause_s = self._pause_s(daq, period)
            outputs = self.amplitude_v * np.sin(2.0 * np.pi / period * np.arange(60 * daq.block))
            recorded = self.record(daq, outputs[: 20 * daq.block], {19: pause_s}, np.full(20, period))
            more = self.record(daq, np.zeros((daq.queue_blocks + 4) * daq.block))
        self._require_none_continued(recorded, more, "before a period had come")

    def test_nothing_is_continued_after_0_v(self) -> None:
        """Once 0 V was handed over, without a period, a host that is late leaves 0 V."""
        with self.loopback_running() as daq:
            pause_s = self._pause_s(daq, PERIOD)
            sine, zeros = SINE_BLOCKS, daq.queue_blocks + 4
            outputs = self.amplitude_v * np.sin(2.0 * np.pi / PERIOD * np.arange((sine + 2 * zeros) * daq.block))
            outputs[sine * daq.block :] = 0.0
            periods = np.where(np.arange(sine + 2 * zeros) < sine, PERIOD, 0.0)
            recorded = self.record(daq, outputs, {sine + zeros - 1: pause_s}, periods)
            more = self.record(daq, np.zeros((zeros + math.ceil(pause_s * daq.sample_rate_hz / daq.block)) * daq.block))
        self._require_none_continued(recorded, more, "after 0 V had been handed over")

    def _require_none_continued(self, recorded: LoopbackRecord, more: LoopbackRecord, when: str) -> None:
        if not (recorded.held.any() or more.held.any()):
            self.unproven("the host was not late enough: nothing was missing")
        continued = int(recorded.continued.sum() + more.continued.sum())
        assert continued == 0, f"{continued} outputs were continued {when}"

    def test_the_watchdog_ends_what_is_continued(self) -> None:
        """A host that is late by more than the watchdog finds 0 V, and is told so."""
        with self.punctual(), self.make_visible() as daq:
            daq.start(min(max(self.blocks), daq.capabilities.largest_block))
            watchdog_s = self._pause_s(daq, PERIOD) / PAUSE_SHARE
            wave = self.amplitude_v * np.sin(2.0 * np.pi / PERIOD * np.arange(SINE_BLOCKS * daq.block))
            self.record(daq, wave, periods=np.full(SINE_BLOCKS, PERIOD))
            self.pause(daq, 1.5 * watchdog_s + self.message_s)
            seen, told = self.witness(daq), False
            try:
                for _ in range(math.ceil(2.0 * watchdog_s * daq.sample_rate_hz / daq.block) + daq.queue_blocks):
                    daq.exchange(np.zeros(daq.block))
            except DaqWatchdog:
                told = True
        assert seen is None or seen <= STILL * self.amplitude_v, (
            f"{seen:g} V are on the output, {1.5 * watchdog_s:g} s after the last one was handed over: the watchdog has "
            f"{watchdog_s:g} s"
        )
        assert told, f"the driver did not report that the watchdog of {watchdog_s:g} s had bitten"
        with self.make_visible() as daq:
            daq.clear()  # what this test has made latch

    def _pause_s(self, daq: DAQ, period: float) -> float:
        """Time to be late by: well beyond the queue, and below the watchdog; skips what these tests do not concern."""
        if not has_clock(daq):
            self.skip("the device waits for the host: nothing comes too late")
        if float(daq.identity.get("longest_period", 0)) < period:
            self.skip(f"the device does not say that it goes on with a period of {period:g} samples")
        adjustable = daq.adjustable
        queue_s = (daq.queue_blocks + 4) * daq.block / daq.sample_rate_hz
        watchdog_s = adjustable.watchdog_s if adjustable is not None else 2.0 * queue_s / PAUSE_SHARE
        if PAUSE_SHARE * watchdog_s < queue_s:
            self.unproven(f"the watchdog of {watchdog_s:g} s is too short for a queue of {daq.queue_blocks}")
        return PAUSE_SHARE * watchdog_s
