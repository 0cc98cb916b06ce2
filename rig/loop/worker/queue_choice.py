"""The queue of a device for a run: that of the bench, or with ``queue_blocks = "auto"`` what is measured at 0 V before.

A queue is the time that the host may be late, and a delay of the loop. The shortest one that would not have been late is
taken, by the rule of `rig.loop.recommendation`; of a device that goes on with the vibration where outputs come too late, the
shortest that would not have been late for 99 % of the blocks. A plan that answers nothing it measures does not care for the
delay: its outputs lie in the device as early as the device can keep them. Neither is longer than `LONGEST_S` or the watchdog:
an end that the host decides acts a queue later, and shall not act later than the watchdog would. A loop's delay is also bounded
by its gains and by `usual_delay_s`.
"""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple, TypedDict

from rig.bench import Bench
from rig.daq import DAQ, Adjustable
from rig.loop.recommendation import RESERVE, Timing, milliseconds, queue_reason, shortest_queue
from rig.loop.worker.probe import measured_timing

MEASURED_S = 1.5  # for which 0 V is exchanged before a queue is chosen; chosen
LONGEST_S = 0.1
"""Longest queue that is chosen, s, unless a block lasts longer."""
SHORT_S = 0.01  # a delay that is allowed at any frequency
HOLD_SAMPLES = 1.0  # of the converter, at most


class DelayBounds(TypedDict):
    """What a plan says of the delay of its loop."""

    feedback: bool
    """Whether the outputs of the plan answer what is measured."""
    delay_s: float
    """Longest delay from output to input that the gains bear, s."""


class QueueChoice(NamedTuple):
    """The queue of a run, and why."""

    how: Literal["bench", "lockstep", "measured", "open loop"]
    """``bench``: a number of the bench; ``lockstep``: the device waits; ``open loop``: nothing answers what is measured."""
    blocks: int
    latency_samples: float
    """Delay from an output to its effect with this queue, as far as known before the device runs."""
    text: str
    """The choice and its reason in one line; empty for a number of the bench."""
    note: str = ""
    """Why the computer runs the loop of a bench that would have it on the device; empty if it would not."""

    @property
    def remark(self) -> str:
        """Line for the person who runs the test; empty where there was nothing to choose."""
        return self.text if self.how in ("measured", "open loop") else ""


def settle_queue(
    daq: DAQ,
    bench: Bench,
    *,
    feedback: bool = True,
    delay_s: float = math.inf,
    asked: Callable[[], str] = str,
    seconds: float = MEASURED_S,
) -> QueueChoice | None:
    """Set the queue of an open device that does not run; return the choice, None for a driver without a queue to set.

    If it has to be measured, 0 V is exchanged for some ``seconds`` with the longest queue and watchdog, so that nothing
    latches. ``feedback``: whether the plan's outputs answer what is measured; then ``delay_s`` is the longest delay from output
    to input that its gains bear. ``asked`` returns why the measurement is to end early. Raises `rig.errors.DaqError`, also for
    that.
    """
    allowed = daq.adjustable
    if allowed is None:
        return None
    if not allowed.automatic:
        return _choice(daq, bench, "bench", queue_of(bench), "")
    if daq.capabilities.repeatable:
        daq.adjust(1)
        return _choice(daq, bench, "lockstep", 1, "the device waits for the host")
    if not feedback:
        longest, bound = _longest(allowed, bench, math.inf)
        daq.adjust(longest)
        lasts = milliseconds(longest * bench.block / bench.sample_rate_hz)
        why = f"lasts {lasts}, the longest {bound}: no output of this plan answers what is measured, the delay does not matter"
        return _choice(daq, bench, "open loop", longest, why)
    daq.adjust(allowed.largest_queue, max(allowed.watchdog_s, allowed.watchdog_range_s[1]))
    timing = measured_timing(daq, bench.block, seconds, asked)
    elsewhere = daq.filter_delay_samples + allowed.buffered_blocks * bench.block
    blocks, why = covering_queue(timing, bench, allowed, delay_s - elsewhere / bench.sample_rate_hz)
    daq.adjust(blocks)
    return _choice(daq, bench, "measured", blocks, why)


def queue_of(bench: Bench) -> int:
    """Return the number of blocks that a bench gives its driver's queue; 1 if it gives none."""
    given = bench.driver.options.get("queue_blocks", 1)
    return given if isinstance(given, int) else 1


def presumed_latency(daq: DAQ, bench: Bench, queue_blocks: int) -> float:
    """Return the latency in samples as far as known before the device is started: queue, buffer, hold and filters."""
    buffered = daq.adjustable.buffered_blocks if daq.adjustable else 0
    return (queue_blocks + buffered) * bench.block + HOLD_SAMPLES + daq.filter_delay_samples


def _choice(
    daq: DAQ, bench: Bench, how: Literal["bench", "lockstep", "measured", "open loop"], blocks: int, why: str
) -> QueueChoice:
    text = f"queue_blocks = {blocks} (auto): {why}" if why else ""
    return QueueChoice(how, blocks, presumed_latency(daq, bench, blocks), text)


def _longest(allowed: Adjustable, bench: Bench, delay_s: float) -> tuple[int, str]:
    """Return the longest queue, blocks, that may be chosen, and what bounds it; ``delay_s``: allowed from output to input."""
    block_s = bench.block / bench.sample_rate_hz
    watchdog_s = min(LONGEST_S, allowed.watchdog_s)
    loop_s = delay_s - block_s - HOLD_SAMPLES / bench.sample_rate_hz
    bounds = [
        (allowed.largest_queue, "that the device has"),
        (_whole(watchdog_s / block_s), f"within {watchdog_s:g} s, for nothing shall act later than the watchdog would"),
        (_whole(loop_s / block_s), f"with which the loop's delay stays within {milliseconds(delay_s)}")
        if math.isfinite(delay_s)
        else (allowed.largest_queue, ""),
    ]
    longest, bound = min(bounds, key=lambda one: one[0])
    return max(1, longest), bound


def _whole(blocks: float) -> int:
    return math.floor(blocks + 1e-9)


def usual_delay_s(bench: Bench) -> float:
    """Return the longest delay of a loop whatever its gains, s: half a period of the specimen, or 10 ms if longer.

    The paper's controller on the magnet beam hunts from three quarters of a period on. What comes later is continued by the
    device, or held, which disturbs less than a loop that acts so late.
    """
    return max(0.5 / bench.specimen.linear_frequency_hz, SHORT_S)


def covering_queue(timing: Timing, bench: Bench, allowed: Adjustable, delay_s: float = math.inf) -> tuple[int, str]:
    """Return the shortest queue, blocks, that covers the measured times by the rule, or the longest allowed; and why.

    Of a device that goes on with the period of the specimen, only the lateness of 99 % of the blocks is covered: continued
    outputs do less harm than a longer delay of the loop. ``delay_s``: longest delay that the gains bear.
    """
    longest, bound = _longest(allowed, bench, min(delay_s, usual_delay_s(bench)))
    block, rate_hz = bench.block, bench.sample_rate_hz
    late = ""
    if allowed.longest_period * bench.specimen.linear_frequency_hz >= rate_hz and math.isfinite(timing.late_99_s):
        late = (
            f"99 % of the blocks came within {milliseconds(timing.late_99_s)}, later ones are continued by the device"
        )
        timing = timing._replace(late_s=timing.late_99_s / RESERVE)
    needed = shortest_queue(timing, block, rate_hz, allowed)
    blocks = min(needed, longest)
    why = queue_reason(timing, blocks, block, rate_hz, allowed, late)
    if needed > longest:
        why += (
            f"; that would be {needed} blocks, and {longest} are the longest {bound}: some outputs will come too late"
        )
    return blocks, why
