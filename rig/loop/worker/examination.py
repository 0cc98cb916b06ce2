"""Examination of a bench's device at 0 V for ``rig doctor --daq``: measured, recommended, and tried."""

import contextlib
import math
import time
from typing import TypeAlias, cast

from rig.bench import Bench, DriverChoice
from rig.daq import Adjustable
from rig.drivers import make_daq
from rig.errors import DaqRefused, DaqWatchdog, RigError
from rig.loop.recommendation import BUSY, REACHED, Recommendation, Settings, complaints, recommend
from rig.loop.worker.memory import chunk_of
from rig.loop.worker.pace import pacing_of
from rig.loop.worker.placement import NO_QUEUE, who_runs
from rig.loop.worker.probe import Advice, DeviceReport, Settable, Tried, round_trips, timing_of
from rig.loop.worker.queue_choice import covering_queue, queue_of

Asked: TypeAlias = tuple[Adjustable | None, Settings, bool]
"""What a device lets one set, the settings of the bench, and whether the device has a clock of its own."""

LATCHED = "the watchdog has latched while settings were tried; it is left so, and a run that is armed clears it"
MEASURED_S, TRIED_S, AS_IS_S = 1.5, 1.0, 1.0  # a first measurement, a try, the settings of the bench; chosen
TRIES = 3  # of settings, each with twice the queue or a longer block
MUCH_LONGER = 4  # times the block, where the rate is not reached
RATE_TRIES = 2  # of sample rates; chosen
LONGER_BLOCKS = (2, 5, 10, 20, 50, 100, 200, 500, 1000)  # samples, tried where a device refuses the block of the bench
LONGEST_BLOCK_S = 0.2  # as `rig.bench.Bench` allows
HIGHER = 1.05  # a largest rate that is not more than this many times the bench's is not tried


def examine_device(bench: Bench, seed: int, seconds: float = MEASURED_S) -> DeviceReport:
    """Exchange 0 V with a bench's device for some seconds; return the timing and a ``recommendation`` with its reasons.

    For ``seconds`` the device has the longest queue and watchdog, so that nothing latches. Then the settings that
    `rig.loop.recommendation` gives are tried, with a longer queue or block if they do not hold; then a higher sample rate; last
    the settings of the bench, unless its watchdog would end that: the report is with these, where they were tried. Nothing is
    driven, and nothing that has latched is cleared: an examination that has made the watchdog latch ends there. Where the
    device runs the loop, samples are exchanged in blocks of 20 ms, and there is nothing to recommend.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError`.
    """
    began = time.monotonic()
    if _has_loop(bench, seed):
        facts = round_trips(bench.model_copy(update={"block": chunk_of(bench)}), seed, seconds)
        if "failure" not in facts:
            facts |= {"recommendation": _as_it_is(NO_QUEUE)}
        return facts | {"examined_s": round(time.monotonic() - began, 1)}
    opened, (allowed, now, by_device), refusal = _that_opens(bench, seed)
    if by_device:
        patient = now
        if allowed is not None:
            longest_s = max(now.watchdog_s or 0.0, allowed.watchdog_range_s[1])
            patient = Settings(now.block, allowed.largest_queue, longest_s)
        opened = with_settings(opened, patient, bench.sample_rate_hz)
    facts = round_trips(opened, seed, seconds)
    if "latched" not in facts and "failure" not in facts:
        if by_device:
            now = now._replace(block=bench.block)
            if allowed is not None and allowed.automatic:
                now = now._replace(queue_blocks=covering_queue(timing_of(facts), bench, allowed)[0])
            facts = _Examination(bench, seed, now, allowed, facts).report(refusal)
        else:
            why = "the device waits for the host: no output is late, and neither queue nor watchdog needs to be changed"
            facts |= {"recommendation": _as_it_is(why)}
    return facts | {"examined_s": round(time.monotonic() - began, 1)}


def _has_loop(bench: Bench, seed: int) -> bool:
    """Return whether the device of a bench runs its loop."""
    if bench.driver.options.get("loop", "computer") == "computer":
        return False
    with make_daq(bench, seed) as daq:
        return who_runs(daq, bench)[0]


def _as_it_is(why: str) -> Advice:
    """Return a recommendation that changes nothing."""
    return {"settings": {}, "differs": {}, "reasons": {"queue_blocks": why}, "tried": [], "bench_lines": []}


def with_settings(bench: Bench, settings: Settings, rate_hz: float) -> Bench:
    """Return a bench with other settings and another sample rate; queue and watchdog only if its driver has them."""
    options = dict(bench.driver.options)
    if settings.watchdog_s is not None:
        options |= {"queue_blocks": settings.queue_blocks, "watchdog_s": settings.watchdog_s}
    driver = DriverChoice(name=bench.driver.name, options=options)
    return bench.model_copy(update={"driver": driver, "block": settings.block, "sample_rate_hz": rate_hz})


def bench_lines(differs: Settable) -> list[str]:
    """Return lines of a bench file with the settings that differ from those of the bench; empty if none do."""
    options = [f"{name} = {differs[name]:g}" for name in ("queue_blocks", "watchdog_s") if name in differs]
    block = [f"block = {differs['block']}"] if "block" in differs else []
    return [*block, *([""] if block and options else []), *(["[driver.options]", *options] if options else [])]


def _that_opens(bench: Bench, seed: int) -> tuple[Bench, Asked, str]:
    """Return the bench, or, if the device or its wire refuses that, with the shortest block that is not; and the refusal."""
    try:
        return bench, _asked(bench, seed), ""
    except DaqRefused as error:
        for block in LONGER_BLOCKS:
            if bench.block < block <= LONGEST_BLOCK_S * bench.sample_rate_hz:
                longer = bench.model_copy(update={"block": block})
                with contextlib.suppress(DaqRefused):
                    return longer, _asked(longer, seed), str(error)
        raise


def _asked(bench: Bench, seed: int) -> Asked:
    with make_daq(bench, seed) as daq:
        allowed = daq.adjustable
        watchdog_s = allowed.watchdog_s if allowed else None
        return allowed, Settings(bench.block, queue_of(bench), watchdog_s), pacing_of(daq) == "device"


class _Examination:
    """What follows the first measurement of a device with a clock."""

    def __init__(self, bench: Bench, seed: int, now: Settings, allowed: Adjustable | None, facts: DeviceReport) -> None:
        self._bench, self._seed, self._now, self._allowed, self._facts = bench, seed, now, allowed, facts
        self._timing, self._rate_hz = timing_of(facts), bench.sample_rate_hz
        self._tried: list[Tried] = []
        self._as_is: DeviceReport | None = None  # report with the settings of the bench

    def report(self, refusal: str) -> DeviceReport:
        """Try settings and rates; return the whole report. ``refusal``: of the settings of the bench, empty without one."""
        advice = recommend(self._timing, self._now, self._rate_hz, self._allowed, self._facts["largest_block"])
        advice = self._try_settings(advice)
        rate_hz, rate_was_tried = self._try_rates(advice)
        facts = self._facts if refusal else self._try_bench()
        remarks = complaints(self._timing, self._now, self._rate_hz, self._allowed, facts["reached_hz"])
        remarks = [*facts["remarks"], *([refusal] if refusal else _said(self._as_is)), *remarks]
        remarks += [LATCHED] if self._has_latched() else []
        chosen = {**advice.settings._asdict(), "largest_rate_hz": rate_hz}
        reasons = dict(advice.reasons)
        reasons["largest_rate_hz"] += "; tried" if rate_was_tried else ""
        now = self._now._asdict()
        changed = {name: value for name, value in advice.settings._asdict().items() if value != now[name]}
        differs = cast(Settable, changed)
        if self._allowed is not None and self._allowed.automatic:
            if "block" in differs:
                differs.pop("queue_blocks", None)
            if "queue_blocks" not in differs:
                reasons["queue_blocks"] = f'as "auto" takes it before a run: {reasons["queue_blocks"]}'
        told: Advice = {
            "settings": cast(Settable, {name: value for name, value in chosen.items() if value is not None}),
            "differs": differs,
            "reasons": reasons,
            "measured": {name: round(value, 7) for name, value in self._timing._asdict().items()},
            "delay_s": round((1 + advice.settings.queue_blocks) * advice.settings.block / self._rate_hz, 7),
            "holds": bool(self._tried and self._holds(advice.settings)),
            "tried": self._tried,
            "bench_lines": bench_lines(differs),
        }
        return facts | {"remarks": remarks, "recommendation": told}

    def _attempt(self, settings: Settings, rate_hz: float, seconds: float) -> DeviceReport:
        try:
            facts = round_trips(with_settings(self._bench, settings, rate_hz), self._seed, seconds)
        except RigError as error:
            facts = {"failure": f"{type(error).__name__}: {error}"}
        if settings == self._now and rate_hz == self._rate_hz and "block_us" in facts:
            self._as_is = facts
        known = dict(facts)
        counts = ("blocks", "held_blocks", "lost_blocks", "reached_hz", "failure", "latched")
        told = {
            **{name: value for name, value in settings._asdict().items() if value is not None},
            "sample_rate_hz": rate_hz,
            **{name: known[name] for name in counts if name in known},
        }
        self._tried.append(cast(Tried, told))
        return facts

    def _holds(self, settings: Settings) -> bool:
        """Whether settings were tried at the bench's rate, and no output was held or sample lost in the last such try."""
        for told in reversed(self._tried):
            if (told["block"], told["queue_blocks"]) == settings[:2] and told["sample_rate_hz"] == self._rate_hz:
                return _is_good(told)
        return False

    def _try_settings(self, advice: Recommendation) -> Recommendation:
        for _ in range(TRIES):
            self._attempt(advice.settings, self._rate_hz, TRIED_S)
            told = self._tried[-1]
            if _is_good(told) or _has_ended(told) or self._allowed is None:
                break
            longer = self._longer(advice.settings, told)
            if longer is None:
                break
            name = "queue_blocks" if longer.block == advice.settings.block else "block"
            count = f"{told['held_blocks']} of {told['blocks']} blocks held, {told['lost_blocks']} lost"
            why = f"{advice.reasons[name]}; tried with {getattr(advice.settings, name)}: {count}, "
            why += f"{told['reached_hz']:g} Hz reached"
            advice = advice._replace(settings=longer, reasons=advice.reasons | {name: why})
        return advice

    def _longer(self, settings: Settings, told: Tried) -> Settings | None:
        """Return settings with twice the queue, or with a longer block where the queue has no room or the rate is not reached.

        A longer block takes a queue of the same duration. None if there is nothing longer.
        """
        assert self._allowed is not None
        largest = self._allowed.largest_queue
        if _is_quick(told) and settings.queue_blocks < largest:
            return settings._replace(queue_blocks=min(2 * settings.queue_blocks, largest))
        blocks = sorted(size for size in self._allowed.wire_share if size <= self._facts["largest_block"])
        longer = [
            size for size in blocks if size >= (settings.block + 1 if _is_quick(told) else MUCH_LONGER * settings.block)
        ]
        if not longer:
            return None
        queue = math.ceil(settings.queue_blocks * settings.block / longer[0] + 1.0 - BUSY)
        return settings._replace(block=longer[0], queue_blocks=min(queue, largest))

    def _try_rates(self, advice: Recommendation) -> tuple[float, bool]:
        """Try the largest rate, then one between; return the largest that held, and whether it was tried."""
        settings, rate_hz = advice.settings, advice.largest_rate_hz
        if self._allowed is None or rate_hz <= HIGHER * self._rate_hz or not self._holds(settings):
            return (self._rate_hz if self._holds(settings) else rate_hz), False
        for _ in range(RATE_TRIES):
            queue = math.ceil(settings.queue_blocks * rate_hz / self._rate_hz)
            longer = settings._replace(queue_blocks=min(queue, self._allowed.largest_queue))
            self._attempt(longer, rate_hz, TRIED_S)
            if _is_good(self._tried[-1]):
                return rate_hz, True
            if _has_ended(self._tried[-1]) and "blocks" in self._tried[-1]:  # a rate that is refused has ended nothing
                break
            rate_hz = float(f"{math.sqrt(rate_hz * self._rate_hz):.2g}")
        return self._rate_hz, True

    def _try_bench(self) -> DeviceReport:
        """Return the report with the settings of the bench; that of the first measurement if they are not tried."""
        if self._as_is is None and not self._has_latched() and not self._would_trip():
            self._attempt(self._now, self._rate_hz, AS_IS_S)
        return self._as_is or self._facts

    def _has_latched(self) -> bool:
        return any(told.get("failure", "").startswith(DaqWatchdog.__name__) for told in self._tried)

    def _would_trip(self) -> bool:
        """Whether by what was measured the bench's watchdog trips: it is too short, or the usual output comes too late."""
        if self._now.watchdog_s is None:
            return False
        lasts_us = 1e6 * max(1, self._now.queue_blocks) * self._now.block / self._rate_hz
        return self._now.watchdog_s < self._timing.gap_s or lasts_us < self._facts["late_us"]["p50"]


def _is_good(told: Tried) -> bool:
    """Whether settings that were tried hold: nothing failed, no output was held, no block lost, and the rate was reached."""
    return not _has_ended(told) and told["held_blocks"] == told["lost_blocks"] == 0 and _is_quick(told)


def _is_quick(told: Tried) -> bool:
    return bool(told["reached_hz"] >= REACHED * told["sample_rate_hz"])


def _has_ended(told: Tried) -> bool:
    """Whether nothing more can be tried: the device has failed, or its watchdog has latched."""
    return "failure" in told or "latched" in told


def _said(facts: DeviceReport | None) -> list[str]:
    """Return what is wrong in the report with the settings of the bench."""
    if facts is None:
        return [
            "the settings of the bench were not tried: the watchdog has ended it, or would have by what was measured"
        ]
    out = []
    if facts["held_blocks"]:
        out.append(f"outputs were held in {facts['held_blocks']} of {facts['blocks']} blocks: they came too late")
    if facts["lost_blocks"]:
        out.append(f"{facts['lost_blocks']} of {facts['blocks']} blocks were lost in transmission")
    return out
