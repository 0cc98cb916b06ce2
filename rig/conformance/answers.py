"""What a loopback reads of random outputs, and the answer to one output that this amounts to."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from rig.bench import Bench
from rig.conformance.subject import TOO_BUSY, DriverUnderTest, has_clock
from rig.daq import CONTINUED, DAQ, HELD, LOST, Channel, flag_names

FILTER_SAMPLES = 32  # over which a filter spreads an output
LONGEST_RUN_S = 30.0  # s; chosen: longest run of a test that a person waits for
FARTHEST = 6.0  # times its RMS: beyond it there is no noise in any number of samples that is tried
MEDIAN_TO_RMS = 1.4826  # of the magnitude of a normal variable
SHORTEST_BLOCK_S = 0.001  # of a device with a clock, over hundreds of blocks
TOO_LATE = (HELD, CONTINUED, "watchdog")
"""Flags of samples at which the converter had another output, because the next one came too late."""
NO_LOOPBACK = (
    "nothing shows the output itself: connect it to an input, by a cable or a tee, and declare that channel with "
    "loopback = true"
)


def with_loopback(bench: Bench) -> Bench | None:
    """A bench that has a loopback: itself, or that of a virtual rig with one; None where it takes a cable."""
    if any(channel.loopback for channel in bench.channels):
        return bench
    if bench.driver.name != "virtual":
        return None
    loop = Channel(name="loopback", role="monitor", unit="V", sensitivity_v_per_unit=1.0, loopback=True)
    return bench.model_copy(update={"channels": (*bench.channels, loop)})


class LoopbackRecord(NamedTuple):
    """Outputs and what the loopbacks read of them."""

    outputs: np.ndarray
    """float64[n], V."""
    read: np.ndarray
    """float64[n, loopbacks], V; NaN where it was lost or is none."""
    lost: np.ndarray
    """bool[n]: flagged as lost."""
    held: np.ndarray
    """bool[n]: flagged as held, or continued: another output than this one was on the converter."""
    continued: np.ndarray
    """bool[n]: flagged as continued."""
    put_out: np.ndarray
    """float64[n]: what the driver says was put out in place of what was handed over, V; else NaN."""
    block: int
    queue_samples: int
    """Samples between the handing over of an output and its instant."""
    latency_samples: float
    """As the driver says it."""
    channels: tuple[Channel, ...]
    """The loopbacks."""

    @property
    def usable(self) -> np.ndarray:
        """bool[n]: samples that are there and cannot have been changed by an output that was held, or lost with its row."""
        behind = max(0, math.ceil(self.latency_samples) - self.queue_samples)
        wrong = self.held | self.lost
        near = np.convolve(wrong, np.ones(2 * FILTER_SAMPLES + behind + 1))[FILTER_SAMPLES:][: wrong.size] > 0.5
        return ~self.lost & ~near

    def handed_over(self, instants: np.ndarray) -> np.ndarray:
        """Where the outputs of instants [n] were handed over, [n]; the last ones of the queue have no instant yet."""
        return np.append(instants[self.queue_samples :], np.zeros(self.queue_samples, instants.dtype))[: instants.size]

    @property
    def as_put_out(self) -> np.ndarray:
        """float64[n]: the outputs, and in place of those that came too late what was put out, V."""
        instead = self.handed_over(np.nan_to_num(self.put_out, nan=0.0))
        return np.where(self.handed_over(np.isfinite(self.put_out)), instead, self.outputs)


def delays_of(latency_samples: float, block: int) -> int:
    """Return the delays that are looked at, samples; a fit takes four times as many samples."""
    return math.ceil(max(0.0, latency_samples)) + 2 * block + FILTER_SAMPLES


class Answer(NamedTuple):
    """Answer of a loopback to one output, by least squares."""

    taps: np.ndarray
    """float64[delays]: V/V by the delay in samples."""
    offset_v: float
    left: np.ndarray
    """float64[n]: what the answer leaves unexplained, V."""
    gain_error: float
    """Standard error of the sum of the taps."""

    @classmethod
    def of(cls, recorded: LoopbackRecord, column: int, samples: int | None = None) -> "Answer":
        """Least squares over the first ``samples``; what it leaves, over all."""
        delays = delays_of(recorded.latency_samples, recorded.block)
        outputs, read = recorded.outputs, recorded.read[:, column]
        part = slice(0, None if samples is None else max(samples, 4 * delays))
        columns = [np.concatenate([np.zeros(lag), outputs[: outputs.size - lag]])[part] for lag in range(delays)]
        shifted = np.column_stack([*columns, np.ones(outputs[part].size)])
        there = (recorded.usable & np.isfinite(read))[part]
        found = np.linalg.lstsq(shifted[there], read[part][there], rcond=None)[0]
        taps, offset_v = found[:-1], float(found[-1])
        left = read - offset_v - np.convolve(outputs, taps)[: outputs.size]
        scatter = float(np.std(left[part][there])) / (float(np.std(outputs)) * math.sqrt(max(1, there.sum())))
        return cls(taps, offset_v, left, scatter * math.sqrt(delays))


class LoopbackSteps(DriverUnderTest):
    """Steps of tests that use a loopback."""

    def loopback(self) -> DAQ:
        """A driver that is not open, with a loopback."""
        daq = self.make_loopback()
        if daq is None:
            self.unproven(NO_LOOPBACK)
        return daq

    def answer(self, recorded: LoopbackRecord, column: int, samples: int | None = None) -> Answer:
        """The answer of a loopback, if enough of its readings are usable."""
        if recorded.usable[:samples].sum() < recorded.usable[:samples].size // 2:
            self.unproven(f"{TOO_BUSY}: outputs came too late for half of the samples")
        return Answer.of(recorded, column, samples)

    def record_each_block(self) -> list[LoopbackRecord]:
        """Random outputs in blocks of every size that is tried, up to the largest that the driver allows.

        By a clock none is shorter than a millisecond, which Python is too slow for.
        """
        with self.loopback() as daq:
            shortest = math.ceil(SHORTEST_BLOCK_S * daq.sample_rate_hz) if has_clock(daq) else 1
            blocks = sorted({min(max(block, shortest), daq.capabilities.largest_block) for block in self.blocks})
        recorded = []
        for block in blocks:
            with self.loopback_running(block) as daq:
                samples = 4 * delays_of(daq.latency_samples, block) + 400
                recorded.append(self.record(daq, self.signs(block * -(-samples // block))))
        return recorded

    @contextmanager
    def loopback_running(self, block: int | None = None) -> Iterator[DAQ]:
        """A driver with a loopback that is running, in blocks of a size, or of the largest that is tried."""
        with self.punctual(), self.loopback() as daq:
            daq.start(min(block or max(self.blocks), daq.capabilities.largest_block))
            yield daq

    def record(
        self,
        daq: DAQ,
        outputs: np.ndarray,
        pauses: dict[int, float] | None = None,
        periods: np.ndarray | None = None,
    ) -> LoopbackRecord:
        """Hand over outputs, whole blocks, in one array; ``pauses``: seconds that are waited before a block.

        ``periods``: of the outputs of each block, samples; 0 for none. A run that takes longer than half a minute ends there.
        """
        block, columns = daq.block, [index for index, channel in enumerate(daq.channels) if channel.loopback]
        names = flag_names(daq.counters)
        bits = {name: 1 << names.index(name) for name in TOO_LATE if name in names}
        voltages, flags = np.zeros(block), np.zeros(outputs.size, int)
        read = np.full((outputs.size, len(columns)), np.nan)
        put_out = np.full(outputs.size, np.nan)
        began, end = time.monotonic(), outputs.size
        for first in range(0, outputs.size, block):
            if pauses and first // block in pauses:
                self.pause(daq, pauses[first // block])
            voltages[:] = outputs[first : first + block]
            daq.continuation["period_samples"] = 0.0 if periods is None else periods[first // block]
            read[first : first + block] = daq.exchange(voltages)[:, columns]
            flags[first : first + block] = daq.flags
            put_out[first : first + block] = daq.put_out
            if time.monotonic() - began > LONGEST_RUN_S:
                end = first + block
                break
        channels = tuple(daq.channels[column] for column in columns)
        read /= [channel.sensitivity_v_per_unit for channel in channels]
        flagged = (LOST, sum(bits.values()), bits.get(CONTINUED, 0))
        lost, held, continued = (flags[:end] & mask != 0 for mask in flagged)
        arrays = outputs[:end], read[:end], lost, held, continued, put_out[:end]
        return LoopbackRecord(*arrays, block, daq.queue_samples, daq.latency_samples, channels)
