"""A device that runs at a multiple of the loop's rate, so that it needs no anti-alias filter of its own.

The staircase of an output that is held for a sample has images at ``k f_s +- f``, and sampling at ``f_s`` folds them back onto
f. With N device samples per sample of the loop, the output goes to its next voltage in N steps on a straight line, which leaves
an image near ``f_s`` the square of its share in a staircase, ``sinc^2``. A linear-phase low-pass takes what is left, and
anything else above half of the loop's rate, before one input in N is kept. Images about ``N f_s`` remain.
"""

from functools import cache
from typing import TypeAlias

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ, Adjustable, Capabilities, Image
from rig.drivers.resampling import decimate, draw_lines, reduce_events
from vibrolock.arrays import Float
from vibrolock.compiled import bound

Taps: TypeAlias = Float

STOPPED_DB = 80.0  # attenuation of what would alias into the pass band; chosen: a sixteen-bit converter has 96 dB
PASS_BAND, STOP_BAND = 0.4, 0.6  # edges over the loop's rate: what lies between aliases into 0.4 to 0.5 alone


@cache
def decimation_taps(oversample: int) -> Taps:
    """Return the low-pass in front of the decimation, float[m], m odd, sum 1.

    A windowed sinc by Kaiser's formulas (Oppenheim and Schafer, Discrete-Time Signal Processing, 7.6): flat within 0.01 % to
    0.4 of the loop's rate, 80 dB down from 0.6 of it.

    Parameters
    ----------
    oversample
        Samples of the device per sample of the loop.
    """
    from scipy.signal import firwin, kaiserord  # on use: it takes long to load, and few benches need it

    count, beta = kaiserord(STOPPED_DB, 2.0 * (STOP_BAND - PASS_BAND) / oversample)
    return np.asarray(firwin(count | 1, 0.5 / oversample, window=("kaiser", beta), fs=1.0), float)


def decimation_delay(oversample: int) -> float:
    """Delay of the low-pass in front of the decimation, in samples of the device; 0 without one."""
    return 0.0 if oversample == 1 else 0.5 * (decimation_taps(oversample).size - 1)


def at_loop_rate(device: DAQ, bench: Bench) -> DAQ:
    """Return the driver of a bench's device as its loop sees it: itself, or at the loop's rate."""
    return device if bench.oversample == 1 else OversampledDAQ(device, bench)


class OversampledDAQ(DAQ):
    """A driver whose device takes ``bench.oversample`` samples for each of the loop's; the loop sees its own rate.

    Counters and statistics are the device's own and count its samples. A lost sample of the device loses all samples of the
    loop whose filter needs it. Not modelled: where the device put out something else than what it was given, `put_out` has what
    it was at the end of the sample.
    """

    def __init__(self, device: DAQ, bench: Bench) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self.device = device
        self.wall_clock = device.wall_clock
        self._times = bench.oversample
        self._taps = decimation_taps(self._times)
        self._past = np.zeros((self._taps.size - 1, len(bench.channels)))

    @property
    def capabilities(self) -> Capabilities:
        """Those of the device, with its blocks in samples of the loop."""
        found = self.device.capabilities
        return found.model_copy(update={"largest_block": max(1, found.largest_block // self._times)})

    @property
    def latency_samples(self) -> float:
        """That of the device, with the delay of the decimation filter.

        The line reaches its voltage with the last of N device samples, which is also the last that a filtered input holds.
        """
        return (self.device.latency_samples + decimation_delay(self._times)) / self._times

    @property
    def filter_delay_samples(self) -> float:
        """Delay of the filters of the device and of the decimation."""
        return (self.device.filter_delay_samples + decimation_delay(self._times)) / self._times

    @property
    def queue_samples(self) -> int:
        """That of the device."""
        return self.device.queue_samples // self._times

    @property
    def counters(self) -> dict[str, int]:
        """Those of the device, in its samples."""
        return self.device.counters

    @property
    def identity(self) -> dict[str, str]:
        """That of the device, with its rate."""
        return {**self.device.identity, "device_rate_hz": f"{self.device.sample_rate_hz:g}"}

    @property
    def statistics(self) -> dict[str, float]:
        """Those of the device."""
        return self.device.statistics

    @property
    def remarks(self) -> tuple[str, ...]:
        """Those of the driver."""
        return self.device.remarks

    @property
    def images(self) -> tuple[Image, ...]:
        """Images about the rate of the device."""
        return self.device.images

    def image_shares(self, frequency_hz: Float) -> dict[str, np.ndarray]:
        """Images about the rate of the device."""
        return self.device.image_shares(frequency_hz)

    @property
    def latched(self) -> str:
        """What the device had latched."""
        return self.device.latched

    def clear(self) -> None:
        """Reset what the device had latched."""
        self.device.clear()

    @property
    def adjustable(self) -> Adjustable | None:
        """What the driver's options set, in samples of the loop."""
        found, times = self.device.adjustable, self._times
        if found is None:
            return None
        lowest, highest = found.rate_range_hz
        return found._replace(
            rate_range_hz=(lowest / times, highest / times),
            wire_share={size // times: share for size, share in found.wire_share.items() if size % times == 0},
            longest_period=found.longest_period // times,
        )

    def adjust(self, queue_blocks: int, watchdog_s: float | None = None) -> None:
        """Take another queue and watchdog."""
        self.device.adjust(queue_blocks, watchdog_s)

    def _open(self) -> None:
        self.device.open()

    def _start(self) -> None:
        self._last_v, self._has_begun = 0.0, False
        size, inputs = self.block * self._times, np.zeros(self._shape)
        self._drawn, read = np.zeros(size), np.zeros((size, len(self.channels)))
        device_flags, device_put_out = np.zeros(size, np.uint16), np.zeros(size)
        # before the device starts, whose clock does not wait until they are loaded
        self._draw_lines = bound(draw_lines, 0.0, np.zeros(self.block), self._drawn)
        self._decimate = bound(decimate, self._past, read, self._taps, inputs)
        self._reduce_events = bound(reduce_events, device_flags, device_put_out, inputs, self.flags, self.put_out)
        self.device.start(size)

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        device, times = self.device, self._times
        device.meanwhile = self.do_meanwhile
        device.continuation["period_samples"] = times * self.continuation["period_samples"]
        device.continuation["ramp_samples"] = times * self.continuation["ramp_samples"]
        self._draw_lines(self._last_v, voltages, self._drawn)
        self._last_v = float(voltages[-1])
        read = device.exchange(self._drawn)
        if not self._has_begun:
            self._past[:] = read[0]  # as if the first reading had always been there
            self._has_begun = True
        self._decimate(self._past, read, self._taps, inputs)
        self._reduce_events(device.flags, device.put_out, inputs, self.flags, self.put_out)

    def _stop(self) -> None:
        self.device.stop()

    def _close(self) -> None:
        self.device.close()
