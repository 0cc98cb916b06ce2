"""The index equation and the latency, by a channel that the output itself is connected to."""

import math

import numpy as np

from rig.bench import Bench
from rig.conformance.subject import DriverUnderTest
from rig.daq import DAQ, Channel

__all__ = ["LoopbackTests", "with_loopback"]

LATE_SAMPLES = 0.25  # as `rig check` allows
FILTER_SAMPLES = 32  # over which a filter spreads an output
LEAST_TAP = 0.05  # of the largest: below it is noise
NO_LOOPBACK = "no channel is declared with loopback = true: nothing shows the output itself"


def with_loopback(bench: Bench) -> Bench | None:
    """A bench that has a loopback: itself, or that of a virtual rig with one; None where it takes a cable."""
    if any(channel.loopback for channel in bench.channels):
        return bench
    if bench.driver.name != "virtual":
        return None
    loop = Channel(name="loopback", role="monitor", unit="V", sensitivity_v_per_unit=1.0, loopback=True)
    return bench.model_copy(update={"channels": (*bench.channels, loop)})


class LoopbackTests(DriverUnderTest):
    """Tests that see the output."""

    def test_every_output_shows_in_the_loopback_once_and_in_its_order(self) -> None:
        """Of random outputs within ``amplitude_v``, none is left out, doubled, or in another's place."""
        for block in self.blocks:
            taps, left = self._loopback(block)
            assert np.abs(left).max() < 0.5 * self.amplitude_v, (
                f"block {block}: the loopback differs by up to {np.abs(left).max():.3g} V from what was handed over, "
                f"whichever of {taps.size} delays it is given"
            )

    def test_the_latency_is_that_of_the_loopback(self) -> None:
        """Outputs show neither earlier nor later than ``latency_samples``, and ``skew_samples`` of the channel, say."""
        for block in self.blocks:
            taps, _ = self._loopback(block)
            taps = np.where(np.abs(taps) > LEAST_TAP * np.abs(taps).max(), taps, 0.0)
            seen = float(np.arange(taps.size) @ taps / taps.sum())
            assert abs(seen - self._said_samples) <= LATE_SAMPLES, (
                f"block {block}: an output shows after {seen:.2f} samples, the driver says {self._said_samples:g}"
            )

    def _loopback(self, block: int) -> tuple[np.ndarray, np.ndarray]:
        """Answer of the loopback to one output by its delay in samples, V/V, and what it leaves unexplained, V."""
        daq = self.make_loopback()
        if daq is None:
            self.skip(NO_LOOPBACK)
        assert daq is not None
        with daq:
            if block > daq.capabilities.largest_block:
                self.skip(f"block {block}: the driver takes up to {daq.capabilities.largest_block}")
            column = next(index for index, channel in enumerate(daq.channels) if channel.loopback)
            daq.start(block)
            self._said_samples = daq.latency_samples + daq.channels[column].skew_samples
            delays = math.ceil(max(0.0, daq.latency_samples)) + 2 * block + FILTER_SAMPLES
            outputs, seen = self._exchanged(daq, block, 4 * delays + 400, column)
        shifted = np.column_stack(
            [np.concatenate([np.zeros(lag), outputs[: outputs.size - lag]]) for lag in range(delays)]
        )
        there = np.isfinite(seen)
        taps = np.linalg.lstsq(shifted[there], seen[there], rcond=None)[0]
        return taps, seen[there] - shifted[there] @ taps

    def _exchanged(self, daq: DAQ, block: int, samples: int, column: int) -> tuple[np.ndarray, np.ndarray]:
        """Random outputs, handed over in one array, and what the loopback reads of them, V."""
        blocks = -(-samples // block)
        outputs = self.amplitude_v * np.random.default_rng(1).choice([-1.0, 1.0], blocks * block)
        voltages, seen = np.zeros(block), np.empty(blocks * block)
        for first in range(0, seen.size, block):
            voltages[:] = outputs[first : first + block]
            seen[first : first + block] = daq.exchange(voltages)[:, column]
        return outputs, seen / daq.channels[column].sensitivity_v_per_unit
