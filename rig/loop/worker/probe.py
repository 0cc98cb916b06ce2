"""Measurements in a loop process at 0 V: how late it is woken, and how quickly a device answers."""

import gc
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypedDict, cast

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ, HELD, LOST, flag_names
from rig.drivers import make_daq
from rig.errors import DaqError
from rig.loop.arrivals import lateness_s, reached_blocks_s
from rig.loop.recommendation import Timing
from rig.loop.worker.histogram import Histogram
from rig.loop.worker.pace import HostPace, pacing_of
from rig.system.privileges import prepare

SETTLE_BLOCKS = 10  # exchanged before times count; chosen
ROUNDING = 1e-9  # of the largest reading: a smaller difference is none
KEPT_ROWS = 20_000  # of readings, for the smallest step between two


class Settable(TypedDict, total=False):
    """Settings that a recommendation names."""

    block: int
    queue_blocks: int
    watchdog_s: float
    largest_rate_hz: float


class Tried(TypedDict, total=False):
    """Settings that were tried, and what came of it."""

    block: int
    queue_blocks: int
    watchdog_s: float
    sample_rate_hz: float
    blocks: int
    held_blocks: int
    lost_blocks: int
    reached_hz: float
    failure: str
    latched: str


class Advice(TypedDict, total=False):
    """A recommendation in the report on a device."""

    settings: Settable
    differs: Settable
    """Those that differ from the bench's."""
    reasons: dict[str, str]
    """One line for each setting."""
    measured: dict[str, float]
    """Times on which it stands, s (`rig.loop.recommendation.Timing`)."""
    delay_s: float
    """Time from the middle of a block to that of the block of outputs that it leads to, s."""
    holds: bool
    """Whether the settings were tried, and held."""
    tried: list[Tried]
    bench_lines: list[str]
    """Lines of a bench file with the settings that differ."""


class DeviceReport(TypedDict, total=False):
    """Report on a bench's device to which 0 V was put out."""

    driver: str
    identity: dict[str, str]
    sample_rate_hz: float
    block: int
    largest_block: int
    paced_by: str
    virtual: bool
    latched: str
    """What the device had latched; only then."""
    remarks: list[str]
    block_us: dict[str, float]
    """Time between two blocks: quantiles."""
    late_us: dict[str, float]
    """How late blocks came (`rig.loop.arrivals.lateness_s`), of a device with a clock: quantiles."""
    latency_samples: float
    driver_us: float
    """Computing time of the driver a block."""
    reached_hz: float
    """Samples received per second."""
    queue_blocks: int
    blocks: int
    held_blocks: int
    lost_blocks: int
    smallest_step_v: dict[str, float]
    """Smallest step between two readings, by channel."""
    failure: str
    """Error that ended it; only then."""
    statistics: dict[str, float]
    """Measurements of the driver itself."""
    counters: dict[str, int]
    recommendation: Advice
    examined_s: float


class WakeUps(TypedDict, total=False):
    """Lateness of a process that is woken at a rate, and the privileges that it was granted."""

    wake_up_us: dict[str, float]
    scheduling: str
    memory: str
    timer_slack: str


def probe(rate_hz: float, seconds: float, privileged: bool) -> WakeUps:
    """Measure the lateness of wake-ups at a rate (Hz); return it with the privileges that were granted."""
    said = prepare(privileged=privileged)
    histogram = Histogram()
    pace = HostPace(1.0 / rate_hz)
    pace.begin()
    for _ in range(round(rate_hz * seconds)):
        now = pace.wait()
        histogram.add(now - pace.release(now))
    gc.enable()
    return cast(WakeUps, {"wake_up_us": histogram.report(), **said})


def round_trips(bench: Bench, seed: int, seconds: float) -> DeviceReport:
    """Open a bench's device, exchange blocks of 0 V with it for some seconds, and return the timing.

    A device that its driver arms is armed, at 0 V, so that it tells which outputs it has held. One that has something
    ``latched`` is left alone.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError`.
    """
    with make_daq(bench, seed) as daq:
        capabilities = daq.capabilities
        out: DeviceReport = {
            "driver": bench.driver.name,
            "identity": dict(daq.identity),
            "sample_rate_hz": bench.sample_rate_hz,
            "block": bench.block,
            "largest_block": capabilities.largest_block,
            "paced_by": pacing_of(daq),
            "virtual": capabilities.virtual,
        }
        if daq.latched:  # nobody has armed the bench, so nothing may be cleared
            return out | {"latched": daq.latched, "remarks": [*daq.remarks]}
        prepare(privileged=out["paced_by"] == "device")  # else the loop would hog the processor
        daq.start(bench.block)
        return out | _report(daq, _exchanged(daq, seconds), out["paced_by"] == "device")


def timing_of(facts: DeviceReport) -> Timing:
    """Return what the recommendation needs of the report of `round_trips`."""
    return Timing(
        late_s=1e-6 * facts["late_us"]["largest"],
        gap_s=1e-6 * facts["block_us"]["largest"],
        round_trip_s=1e-6 * facts["statistics"].get("round_trip_p50_us", 0.0),
        busy_s=1e-6 * facts["driver_us"],
        late_99_s=1e-6 * facts["late_us"]["p99"],
    )


def measured_timing(daq: DAQ, block: int, seconds: float, asked: Callable[[], str] = str) -> Timing:
    """Exchange blocks of 0 V with an open device that has a clock, as it is set, for some seconds; return the times.

    The device is stopped afterwards. ``asked`` returns why that is to end early, or an empty text. Raises
    `rig.errors.DaqError`, also in that case; then it is left to the caller to close the device.
    """
    daq.start(block)
    seen = _exchanged(daq, seconds, asked)
    if seen.failure is not None:
        raise seen.failure
    daq.stop()
    return timing_of(_report(daq, seen, by_device=True))


class _Exchanged(NamedTuple):
    arrivals_s: np.ndarray
    """float64[1 + n]: the beginning, and when each block was there, s."""
    busy_s: float
    """Computing time of this thread."""
    held: int
    """Blocks with a held output."""
    lost: int
    """Blocks that were lost."""
    readings_v: np.ndarray
    """float64[m, n_channels]: the first of the readings."""
    failure: DaqError | None
    """Error that ended it, if one did."""


def _exchanged(daq: DAQ, seconds: float, asked: Callable[[], str] = str) -> _Exchanged:
    block, names = daq.block, flag_names(daq.counters)
    held_flag = 1 << names.index(HELD) if HELD in names else 0
    zeros = np.zeros(block)
    arrivals: list[float] = []
    readings: list[np.ndarray] = []
    held = lost = 0
    failure: DaqError | None = None
    began_s, computed_s = time.monotonic(), time.thread_time()
    try:
        for _ in range(SETTLE_BLOCKS):
            daq.exchange(zeros)
        began_s, computed_s = time.monotonic(), time.thread_time()
        while not arrivals or arrivals[-1] - began_s < seconds:
            if why := asked():
                raise DaqError(why)
            inputs = daq.exchange(zeros)
            arrivals.append(time.monotonic())
            if daq.flags.any():
                flags = int(np.bitwise_or.reduce(daq.flags))
                held += flags & held_flag != 0
                lost += flags & LOST != 0
            if len(readings) * block < KEPT_ROWS:
                readings.append(inputs)
    except DaqError as error:
        failure = error
    kept = np.vstack(readings) if readings else np.empty((0, len(daq.channels)))
    times = np.array([began_s, *arrivals])
    return _Exchanged(times, time.thread_time() - computed_s, held, lost, kept, failure)


def _report(daq: DAQ, seen: _Exchanged, by_device: bool) -> DeviceReport:
    times, blocks = seen.arrivals_s, seen.arrivals_s.size - 1
    out: DeviceReport = {"block_us": _quantiles_us(np.diff(times)), "latency_samples": daq.latency_samples}
    if by_device:
        out["late_us"] = _quantiles_us(lateness_s(times[1:], daq.block / daq.sample_rate_hz))
    out["driver_us"] = round(1e6 * seen.busy_s / max(1, blocks), 2)
    out["reached_hz"] = round(
        reached_blocks_s(times, daq.block / daq.sample_rate_hz if by_device else 0.0) * daq.block, 1
    )
    out |= {"queue_blocks": daq.queue_blocks, "blocks": blocks, "held_blocks": seen.held, "lost_blocks": seen.lost}
    out["smallest_step_v"] = smallest_steps_v([channel.name for channel in daq.channels], seen.readings_v)
    if seen.failure:
        out["failure"] = f"{type(seen.failure).__name__}: {seen.failure}"
    out |= {"statistics": dict(daq.statistics), "counters": dict(daq.counters)}
    out["remarks"] = [*daq.remarks]
    return out


def _quantiles_us(times_s: np.ndarray) -> dict[str, float]:
    """Return the quantiles p50, p99 and p99.9, and the largest time, us; zeros without any."""
    histogram = Histogram()
    for nanoseconds in (1e9 * times_s).astype(np.int64).tolist():
        histogram.add(nanoseconds)
    return histogram.report()


def smallest_steps_v(names: Sequence[str], readings_v: np.ndarray) -> dict[str, float]:
    """Return the smallest step between two different readings float64[n, n_channels], V, by channel.

    Channels whose reading never changed are left out. The step of a converter is seen where noise or signal takes neighbouring
    values.
    """
    out = {}
    for name, column in zip(names, readings_v.T, strict=True):
        levels = np.unique(column[np.isfinite(column)])
        if levels.size > 1:
            steps = np.diff(levels)
            out[name] = float(steps[steps > ROUNDING * np.abs(levels).max()].min())
    return out
