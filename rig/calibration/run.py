"""Calibrate a device: play a multisine through the cables, record it, and write a bench with what was found."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import tomli_w

from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench
from rig.bench.configuration import Table, read_toml
from rig.calibration.paths import InputPath, Paths, fitted_paths, high_pass
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import spectra_of
from rig.campaigns.running.level_search import MultisineSeries
from rig.check.responses import responses_of
from rig.errors import ConfigurationError, DaqError
from rig.system.whole_file import whole_file

PURPOSE = "calibration"
"""Purpose of the recording, in the facts of its parts."""
SHARE = 0.1
"""RMS of the multisine by default, of the largest voltage that limits and ranges allow with the cables; chosen."""
LARGEST_RESOLUTION_HZ = 5.0
"""Largest distance of the lines, Hz; chosen: a multimeter averages over a period of 0.2 s, and its reading is steady."""
LEAST_LINES = 40
"""Least number of lines in the band; chosen."""
SETTLING_S = 2.0
"""Time before the measurement, s; chosen: by then a high-pass of 1 Hz has forgotten the start."""
VOLTS = ("output_full_scale_v", "input_full_scale_v")
"""Options of the driver that hold volts per full scale."""
HIGHEST_SHARE = 0.3
"""Highest line, of the sample rate; chosen: below what filters between two rates bend."""
LEAST_COHERENCE = 0.999
"""Coherence from which on a path is known well enough."""
SAME_SKEW = 0.002
"""Delay between channels, samples, that is not written; chosen: 0.004 degrees at a hundredth of the rate."""


@dataclass(frozen=True)
class Calibrated:
    """What was found, and the recording that it is from."""

    paths: Paths
    bench: Bench
    """The bench that was played on: without what is to be found."""
    rms_v: float
    """RMS of the output by the bench's volts, before its high-pass, V."""
    passed_rms_v: float
    """RMS behind the high-pass of the output, V."""
    recording: Path
    latency_from: str
    """Where the latency comes from, by the driver; empty if it does not say."""

    @property
    def reference(self) -> InputPath:
        """The input whose delay and polarity the others are compared with: the loopback channel's, or the first connected."""
        loopbacks = {channel.name for channel in self.bench.channels if channel.loopback}
        connected = self.paths.connected
        return next((one for one in connected if one.name in loopbacks), connected[0])

    @property
    def uncertain_gain(self) -> float:
        """Relative error of all amplitudes at the specimen's frequency if the output's corner is the inputs', and they its.

        0 unless the inputs are alike: their gains and phases against each other are right in any case.
        """
        if not self.paths.are_alike:
            return 0.0
        at = np.array([self.bench.specimen.linear_frequency_hz])
        ours, other = self.paths.connected[0].high_pass_hz, self.paths.output_high_pass_hz
        return float(abs(abs(high_pass(at, ours)[0] / high_pass(at, other)[0]) - 1.0))


def begun_from(path: Path) -> tuple[Path, Bench]:
    """Return the bench that a calibration begins from, and its file: for one that a calibration wrote, its base with its volts.

    Raises `ConfigurationError` where it cannot be loaded.
    """
    bench = load_bench(path)
    table = read_toml(path)
    own = table.get("driver", {})
    if not isinstance(own, dict) or "calibrated" not in own.get("options", {}):
        return path, bench
    base = path.parent / str(table["base"])
    begun = load_bench(base)
    volts = {name: bench.driver.options[name] for name in VOLTS if name in bench.driver.options}
    driver = begun.driver.model_copy(update={"options": {**begun.driver.options, **volts}})
    return base, begun.model_copy(update={"driver": driver})


def calibrate(
    bench: Bench,
    recording: Path,
    options: RunOptions,
    *,
    rms_v: float | None = None,
    seconds: float = 10.0,
    output_high_pass_hz: float | None = None,
) -> Calibrated:
    """Play a multisine and fit the paths. The output is connected to the inputs by cables, and to nothing else.

    ``output_high_pass_hz``: the output's corner, Hz, as far as known, which says whose corner is whose where inputs are alike.

    Raises `ConfigurationError`, `rig.errors.DaqError`, `rig.errors.NotArmed`, `rig.errors.RecordingError`.
    """
    bare = uncalibrated(bench)
    allowed_v = _largest_v(bare)
    level_v = SHARE * allowed_v if rms_v is None else rms_v
    if level_v > 0.3 * allowed_v:  # a multisine's peak is about three times its RMS
        raise ConfigurationError(
            field="voltage", value=level_v, unit="V", allowed=f"up to {0.3 * allowed_v:.3g} V, for limits and ranges"
        )
    plan = _plan(bare, level_v, seconds)
    with MultisineSeries(bare, recording, options, PURPOSE).play(plan) as recorded:
        points = [point for point in points_of(recorded) if point.rows is not None]
        if not points or points[-1].rows is None:
            why = (recorded.parts[-1].end or {}).get("text", "")
            raise DaqError(f"the multisine was not played to its end, check the cables: {why}")
        rows = recorded.parts[-1].read(points[-1].rows.first_sample, points[-1].rows.end_sample)
        responses = responses_of(bare, spectra_of(bare, plan, {points[-1].realisation or 0: rows}))
        device = recorded.parts[0].information["about"]["device"]
    volts = responses.per_volt * np.array([channel.sensitivity_v_per_unit for channel in bare.channels])[:, None]
    paths = fitted_paths(responses.names, responses.frequency_hz, volts, bare.sample_rate_hz)
    if output_high_pass_hz is not None:
        paths = paths.exchanged(output_high_pass_hz)
    unclear = [
        one.name
        for one, coherence in zip(paths.inputs, responses.coherence, strict=True)
        if one.connected and coherence < LEAST_COHERENCE
    ]
    if unclear or not paths.connected:
        what = f"channel {unclear[0]!r} is too noisy" if unclear else "the output reaches no input"
        raise DaqError(f"{what}; check the cables, or raise --voltage")
    passed = high_pass(responses.frequency_hz, paths.output_high_pass_hz)
    passed_v = level_v * float(np.sqrt(np.mean(np.abs(passed) ** 2)))  # the lines have one amplitude
    return Calibrated(paths, bare, level_v, passed_v, recording, str(device.get("latency_from", "")))


def uncalibrated(bench: Bench) -> Bench:
    """Return the bench without high-passes and skews, with volts for a device that has none yet, on the cables' limits.

    Raises `ConfigurationError` for a calibrated bench: what is in it would be taken for the sensors'.
    """
    options = dict(bench.driver.options)
    if options.get("calibrated"):
        raise ConfigurationError(
            f"was calibrated on {options['calibrated']}",
            where=bench.name,
            hint="begin from the bench that it was made of, its `base`",
        )
    if bench.driver.name == "sound":
        largest_v = max(channel.range_v for channel in bench.channels)
        options.setdefault("output_full_scale_v", bench.output_range_v)
        options.setdefault("input_full_scale_v", largest_v)
    channels = tuple(
        channel.model_copy(update={"high_pass_hz": 0.0, "input_high_pass_hz": 0.0, "skew_samples": 0.0})
        for channel in bench.channels
    )
    driver = bench.driver.model_copy(update={"options": options})
    return bench.model_copy(update={"driver": driver, "channels": channels})


def _largest_v(bench: Bench) -> float:
    """Return the largest voltage that cables may bring to the inputs without reaching a limit or a range, V."""
    limits = {"force": bench.limits.force_n, "drive": bench.limits.acceleration_m_s2}
    limits["response"] = limits["drive"]
    found = [bench.limits.voltage_v, *(channel.range_v for channel in bench.channels)]
    found += [
        limits[channel.role] * abs(channel.sensitivity_v_per_unit)
        for channel in bench.channels
        if channel.role in limits
    ]
    lowest = 2.0 * math.pi * bench.limits.frequency_hz[0]
    found += [
        bench.limits.displacement_m * lowest**2 * abs(channel.sensitivity_v_per_unit)
        for channel in bench.channels
        if channel.role in ("drive", "response")
    ]
    return min(found)


def _plan(bench: Bench, rms_v: float, seconds: float) -> MultisinePlan:
    lowest_hz = bench.limits.frequency_hz[0]
    highest_hz = min(bench.limits.frequency_hz[1], HIGHEST_SHARE * bench.sample_rate_hz)
    wanted_hz = min(LARGEST_RESOLUTION_HZ, (highest_hz - lowest_hz) / LEAST_LINES)
    resolution_hz = bench.sample_rate_hz / math.ceil(bench.sample_rate_hz / wanted_hz)
    return MultisinePlan(
        bench=bench.name,
        description="multisine through cables",
        levels_rms_v=(rms_v,),
        lowest_hz=lowest_hz,
        highest_hz=highest_hz,
        resolution_hz=resolution_hz,
        realisations=1,
        periods=max(2, round(seconds * resolution_hz)),
        transient_periods=math.ceil(SETTLING_S * resolution_hz),
        accepted_change=1.0,
    )


# What is written


def bench_changes(found: Calibrated, bench: Bench, rms_v: float | None = None) -> Table:
    """Return what a bench changes by a calibration; ``rms_v``: reading of a true RMS multimeter on the output, V.

    Without a reading the volts of output and inputs stay those of the bench. A reading is taken behind the output's high-pass;
    the volts are those before it.
    """
    channels = [
        _channel(channel.model_dump(exclude_unset=True), one, found.reference)
        for channel, one in zip(bench.channels, found.paths.inputs, strict=True)
    ]
    options: Table = {"calibrated": datetime.now(UTC).date().isoformat()}
    if found.paths.output_high_pass_hz:
        options["output_high_pass_hz"] = round(found.paths.output_high_pass_hz, 4)
    options |= {name: bench.driver.options[name] for name in VOLTS if name in bench.driver.options}
    if rms_v is not None:
        scale = rms_v / found.passed_rms_v
        of_bench = found.bench.driver.options
        output_v, inputs_v = _number(of_bench["output_full_scale_v"]), of_bench["input_full_scale_v"]
        old = np.broadcast_to(np.asarray(inputs_v, float), len(bench.channels))
        options["output_full_scale_v"] = scale * output_v
        options["input_full_scale_v"] = [
            float(full * scale / abs(one.gain)) if one.connected else float(full)
            for full, one in zip(old, found.paths.inputs, strict=True)
        ]
    return {"driver": {"options": options}, "channels": channels}


def _number(value: object) -> float:
    return float(str(value))


def _channel(table: Table, one: InputPath, reference: InputPath) -> Table:
    """Return the table of a channel with what was found of its input."""
    if not one.connected:
        return table
    table["input_high_pass_hz"] = round(one.high_pass_hz, 4)
    skew = one.delay_samples - reference.delay_samples
    if abs(skew) > SAME_SKEW:
        table["skew_samples"] = round(skew, 4)
    if one.gain * reference.gain < 0.0:
        if table.get("sensitivity"):
            table["inverted"] = not table.get("inverted", False)
        else:
            table["sensitivity_v_per_unit"] = -_number(table["sensitivity_v_per_unit"])
    return table


def write_bench(path: Path, base: str, changes: Table) -> None:
    """Write a bench that begins from ``base`` and has the changes; raises `RecordingError` where it cannot be written."""
    text = f"# Written by `rig calibrate`, which begins from the base; change that.\n{tomli_w.dumps({'base': base, **changes})}"
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")
    load_bench(path)
