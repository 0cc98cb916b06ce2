"""Recommended block, queue, watchdog and sample rate of a device with a clock, from times that were measured at 0 V.

The rule. All times in s, T = block / sample rate:

- **Answer time** of a block: from the instant of its last sample to the arrival of the outputs that it leads to. It is
  ``RESERVE`` times the largest lateness of a block that was seen (`rig.loop.arrivals.lateness_s`), plus the median round trip,
  plus the time that the wire needs for the block.
- **Queue**: the outputs of a block are due q blocks after it, so q T must last for the answer time and the part ``1 - BUSY`` of
  a block more, in which the controller computes. The shortest such q is taken, and a longer block where q is more than the
  device has.
- **Block**: that of the bench, unless the driver needs more than ``BUSY`` of it for computing, or the wire cannot carry it.
  Then the next longer one of 1, 2, 5, 10, 20... samples.
- **Watchdog**: ``GAPS`` times the longest time between two blocks, within what driver and device allow.
- **Largest rate**: the lowest of the device's, of what the wire carries (`rig.daq.Adjustable`), of what the driver can compute
  (``BUSY`` of a block), and of that at which the longest queue still lasts.

A setting of the bench that fulfils the rule is kept, but for a queue of more than twice the length.
"""

import math
from typing import NamedTuple

from rig.daq import Adjustable

RESERVE = 1.5  # of the largest lateness: one or two seconds do not see the largest of a test
BUSY = 0.5  # of a block for the driver's computing; controller and recorder need the rest
GAPS = 3.0  # of the longest time between two blocks
REACHED = 0.99  # of the sample rate
KEPT_QUEUE = 2  # times the queue that is needed: a longer one of the bench is not kept


class Timing(NamedTuple):
    """Times that were measured while blocks of 0 V were exchanged, s."""

    late_s: float
    """Largest lateness of a block."""
    gap_s: float
    """Longest time between two blocks."""
    round_trip_s: float
    """Median round trip of a short message; 0 if the driver does not tell."""
    busy_s: float
    """Computing time of the driver, a block."""
    late_99_s: float = math.inf
    """Lateness within which 99 % of the blocks came."""


class Settings(NamedTuple):
    """What can be set for a bench."""

    block: int
    queue_blocks: int
    watchdog_s: float | None
    """None if the driver has no such option."""


class Recommendation(NamedTuple):
    """Recommended settings, and why."""

    settings: Settings
    largest_rate_hz: float
    holds: bool
    """Whether the rule is fulfilled; False if even the longest block and queue do not last."""
    reasons: dict[str, str]
    """One line for ``block``, ``queue_blocks``, ``watchdog_s`` and ``largest_rate_hz``."""


def answer_s(timing: Timing, wire_s: float) -> float:
    """Return the answer time with its reserve, s; ``wire_s``: time that the wire needs for a block."""
    return RESERVE * timing.late_s + timing.round_trip_s + wire_s


def recommend(
    timing: Timing, now: Settings, rate_hz: float, allowed: Adjustable | None, largest_block: int
) -> Recommendation:
    """Return the recommended settings for a bench that has ``now``, at ``rate_hz``.

    Without ``allowed`` only the block can be chosen; queue and watchdog stay.
    """
    largest_queue = allowed.largest_queue if allowed else max(1, now.queue_blocks)
    block, why_block = _block(timing, now, rate_hz, allowed, largest_block)
    queue = shortest_queue(timing, block, rate_hz, allowed)
    longer = [size for size in _sizes(now.block, allowed, largest_block) if size > block]
    while queue > largest_queue and longer:
        block = longer.pop(0)
        queue = shortest_queue(timing, block, rate_hz, allowed)
        why_block = f"a queue of {largest_queue} shorter blocks does not last"
    holds = queue <= largest_queue
    needed, queue = queue, min(queue, largest_queue)
    if not allowed or (block == now.block and needed <= now.queue_blocks <= KEPT_QUEUE * needed):
        queue = now.queue_blocks
    watchdog, why_watchdog = _watchdog(timing, now, allowed)
    rate, why_rate = _rate(timing, block, rate_hz, allowed, largest_queue)
    why_queue = queue_reason(timing, queue, block, rate_hz, allowed)
    if not holds:
        why_queue += f"; that would be {needed} blocks, and more than {largest_queue} cannot be set"
    reasons = {"block": why_block, "queue_blocks": why_queue, "watchdog_s": why_watchdog, "largest_rate_hz": why_rate}
    if watchdog is None:
        del reasons["watchdog_s"]
    return Recommendation(Settings(block, queue, watchdog), rate, holds, reasons)


def queue_reason(
    timing: Timing, queue: int, block: int, rate_hz: float, allowed: Adjustable | None, late: str = ""
) -> str:
    """Return in one line how long a queue lasts, and how long it must by the rule; ``late`` says how late blocks came."""
    block_s = block / rate_hz
    answered = answer_s(timing, _wire_s(block, rate_hz, allowed))
    late = late or f"blocks came up to {milliseconds(timing.late_s)} late (counted {RESERVE:g} times)"
    return (
        f"lasts {milliseconds(max(1, queue) * block_s)}; {milliseconds(answered + (1.0 - BUSY) * block_s)} are needed: "
        f"{late}, a round trip takes {milliseconds(timing.round_trip_s)}, the controller has "
        f"{milliseconds((1.0 - BUSY) * block_s)}"
    )


def complaints(
    timing: Timing, now: Settings, rate_hz: float, allowed: Adjustable | None, reached_hz: float | None = None
) -> list[str]:
    """Return what is wrong with the settings that a bench has, by what was measured; one line each."""
    out = []
    block_s = now.block / rate_hz
    lasts_s = max(1, now.queue_blocks) * block_s
    seen_s = timing.late_s + timing.round_trip_s + _wire_s(now.block, rate_hz, allowed)
    if seen_s > lasts_s:
        out.append(
            f"outputs answer a block up to {milliseconds(seen_s)} after it (lateness and round trip), and the queue of "
            f"{now.queue_blocks} blocks lasts {milliseconds(lasts_s)}: outputs come too late and are held"
        )
    if now.watchdog_s is not None and now.watchdog_s < timing.gap_s:
        out.append(
            f"the watchdog's {now.watchdog_s:.3g} s are shorter than the longest time between two blocks, "
            f"{timing.gap_s:.3g} s: it ends a run"
        )
    if reached_hz is not None and reached_hz < REACHED * rate_hz:
        out.append(
            f"{reached_hz:.0f} of {rate_hz:.0f} samples a second are reached: device, wire or computer are too slow"
        )
    return out


def _block(
    timing: Timing, now: Settings, rate_hz: float, allowed: Adjustable | None, largest_block: int
) -> tuple[int, str]:
    """Return the shortest block, that of the bench or longer, which driver and wire can carry, and why."""
    busy = f"the driver computes {milliseconds(timing.busy_s)} a block"
    for size in _sizes(now.block, allowed, largest_block):
        fits_wire = not allowed or allowed.wire_share.get(size, 0.0) < allowed.largest_wire_share
        if timing.busy_s <= BUSY * size / rate_hz and fits_wire:
            lasts = f"{busy}, which lasts {milliseconds(size / rate_hz)}"
            return size, lasts if size == now.block else f"{lasts}: at most {BUSY:.0%} are allowed, or the wire is full"
    return now.block, f"{busy}, and no longer block would help"


def _sizes(block: int, allowed: Adjustable | None, largest_block: int) -> list[int]:
    sizes = allowed.wire_share if allowed else [digit * 10**power for power in range(4) for digit in (1, 2, 5)]
    return [block, *(size for size in sorted(sizes) if block < size <= largest_block)]


def _wire_s(block: int, rate_hz: float, allowed: Adjustable | None) -> float:
    """Return the time that the wire needs for a block, s."""
    return block / rate_hz * (allowed.wire_share.get(block, 0.0) if allowed else 0.0)


def shortest_queue(timing: Timing, block: int, rate_hz: float, allowed: Adjustable | None) -> int:
    """Return the shortest queue, blocks, that lasts for the answer time and the controller's part of a block."""
    answered = answer_s(timing, _wire_s(block, rate_hz, allowed)) * rate_hz / block
    return max(1, math.ceil(answered + 1.0 - BUSY - 1e-9))


def _watchdog(timing: Timing, now: Settings, allowed: Adjustable | None) -> tuple[float | None, str]:
    if allowed is None or now.watchdog_s is None:
        return None, ""
    shortest_s, longest_s = allowed.watchdog_range_s
    why = f"the longest time between two blocks was {milliseconds(timing.gap_s)} (counted {GAPS:g} times)"
    wanted_s = GAPS * timing.gap_s
    if wanted_s <= now.watchdog_s:
        return now.watchdog_s, why
    chosen_s = min(max(-_rounded_down(-wanted_s), shortest_s), longest_s)
    return chosen_s, f"{why}; more than {longest_s:g} s are not allowed" if longest_s < wanted_s else why


def _rate(
    timing: Timing, block: int, rate_hz: float, allowed: Adjustable | None, largest_queue: int
) -> tuple[float, str]:
    """Return the largest sample rate (Hz) with a block, rounded down to two digits, and what bounds it."""
    bounds = {}
    if timing.busy_s > 0.0:
        bounds[f"the driver computes {milliseconds(timing.busy_s)} a block"] = BUSY * block / timing.busy_s
    waits_s = answer_s(timing, _wire_s(block, rate_hz, allowed))
    if waits_s > 0.0:
        room = (largest_queue - 1.0 + BUSY) * block
        bounds[f"the longest queue, {largest_queue} blocks, must last for {milliseconds(waits_s)}"] = room / waits_s
    if allowed is not None:
        share = allowed.wire_share.get(block, 0.0)
        if share > 0.0:
            bounds[f"the wire carries {share:.0%} of its capacity at {rate_hz:g} Hz"] = (
                allowed.largest_wire_share * rate_hz / share
            )
        lowest_hz, highest_hz = allowed.rate_range_hz
        bounds["the device samples no faster" if lowest_hz < highest_hz else "it is the rate of the bench"] = highest_hz
    if not bounds:
        return rate_hz, "nothing that limits it was measured"
    why = min(bounds, key=bounds.__getitem__)
    bound = bounds[why]
    if allowed is not None and bound >= allowed.rate_range_hz[1]:
        return allowed.rate_range_hz[1], why
    return (rate_hz if rate_hz <= bound < 1.1 * rate_hz else _rounded_down(bound)), why


def _rounded_down(value: float) -> float:
    """Return a value rounded down to two digits; 0 stays."""
    if value == 0.0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    return float(f"{math.floor(value / step + 1e-9) * step:.2g}")


def milliseconds(seconds: float) -> str:
    """Return a time in ms with three digits."""
    return f"{1e3 * seconds:.3g} ms"
