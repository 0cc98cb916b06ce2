"""Means of a dwell: their contents, their evaluation from recorded rows, and changes that raise an alarm or end the test."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from identification import IdentificationError
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.evaluation.acceptance import level_error, level_objection, settled_point
from rig.campaigns.evaluation.drift import relative_change
from rig.campaigns.evaluation.lost_samples import rms_of_force
from rig.campaigns.evaluation.point import PART, Point, vibration_of
from rig.campaigns.evaluation.recorded import accepted_points, specimen_of
from rig.campaigns.evaluation.rows import Rows, turned_rad
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS
from rig.campaigns.evaluation.vibrations import modal_part, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording
from rig.text.column import Column
from rig.text.contents import Contents

DWELL_COLUMNS = (
    Column("cycles", "cycles", "", ".0f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("frequency_change", "frequency change", "%", "+.3f", 100.0),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("damping_ratio_std", "+-", "%", ".4f", 196.0, in_line=False, optional=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class Length:
    """Length of a mean."""

    cycles_in_mean: float
    """Length in cycles."""
    seconds_in_mean: float
    """Length in seconds."""


@dataclass(frozen=True, kw_only=True)
class HeldLevel:
    """The held quantity, evaluated over a mean."""

    force_rms_n: float
    """RMS of the force samples without their mean value, all harmonics included, N."""
    level_error: float | None
    """Relative deviation of the held quantity from its level; None with levels in volts."""


@dataclass(frozen=True, kw_only=True)
class Changes:
    """Relative changes from the first accepted mean; None where one of the two means lacks the quantity."""

    frequency_change: float | None
    """Relative change of the modal frequency."""
    damping_change: float | None
    """Relative change of the damping ratio, from the first accepted mean that was evaluated with the same mode shape."""
    amplitude_change: float | None
    """Relative change of the displacement amplitude at the drive point; if the displacement is held, of the force."""


@dataclass(frozen=True, kw_only=True)
class DwellResult:
    """Results of a mean in addition to those of every point."""

    cycles: float | None = None
    """Cycles from the beginning of the first mean to the middle of this one."""
    time_s: float | None = None
    """Seconds from the beginning of the first mean to the middle of this one."""
    length: Length | None = field(default=None, metadata=PART)
    """Length of the mean; None if nothing was recorded."""
    held: HeldLevel | None = field(default=None, metadata=PART)
    """The held quantity; None if nothing was evaluated."""
    changes: Changes | None = field(default=None, metadata=PART)
    """Changes from the first accepted mean; None if this mean was not accepted."""


def measure_mean(bench: Bench, plan: DwellPlan, target: Target, rows: Rows, settling: np.void) -> Point[object]:
    """Evaluate frequency, damping and amplitude of one mean over its whole periods, with its quality."""
    cycles = turned_rad(rows) / (2.0 * math.pi) * rows.size / max(1, rows.size - 1)
    length = Length(cycles_in_mean=cycles, seconds_in_mean=rows.size / bench.sample_rate_hz)
    rows = rows[within_periods(rows, int(cycles))]
    try:
        lag_deg = plan.controller.phase_lag_deg + 180.0
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=lag_deg)
        modal = modal_part(vibration, drive_shape(bench, plan.plant))
    except (IdentificationError, ArithmeticError) as error:
        return replace(not_evaluated(plan, target, error, settled=True), result=DwellResult(length=length))
    force_rms_n = rms_of_force(bench, rows)
    missed = level_error(plan.amplitude_law, target.level, vibration, force_rms_n)
    off_level = level_objection(plan.amplitude_law, missed, plan.accepted_level_error)
    point = settled_point(plan, target, bench, vibration, rows, off_level)
    held = HeldLevel(force_rms_n=force_rms_n, level_error=missed)
    return replace(point, modal=modal, result=DwellResult(length=length, held=held))


def watch_drift(plan: DwellPlan, known: Sequence[Point[object]], point: Point[object]) -> tuple[Point[object], str]:
    """Add cycles, time and changes to a mean; also return why the test ends, or an empty string.

    The changes are relative to the first accepted mean, those of the damping to the first one that was evaluated with the same
    mode shape: a resumed plan may have another. Cycles and seconds refer to the middle of the mean and count from the
    first mean, over all parts of a recording. Failed means count too; the ramp and the settling at the beginning of a part do
    not.
    """
    cycles = sum(map(_cycles, known)) + 0.5 * _length(point).cycles_in_mean
    seconds = sum(_length(one).seconds_in_mean for one in known) + 0.5 * _length(point).seconds_in_mean
    result = replace(_result(point) or DwellResult(), cycles=cycles, time_s=seconds)
    if not point.accepted:
        return replace(point, result=result), ""
    first = next((one for one in known if one.accepted), point)
    before, now = _watched(plan, first), _watched(plan, point)
    alike = (one for one in known if one.accepted and _mode_shape(one) == _mode_shape(point))
    before["damping"] = _watched(plan, next(alike, point))["damping"]
    changes = {name: relative_change(before[name], now[name]) for name in now}
    result = replace(
        result,
        changes=Changes(
            frequency_change=changes["frequency"],
            damping_change=changes["damping"],
            amplitude_change=changes["amplitude"],
        ),
    )
    point = replace(point, result=result)
    alarms = [f"alarm: {text}" for text in _beyond(plan, "alarm", changes)]
    abort = next(_beyond(plan, "abort", changes), "")
    return point.warned(*alarms) if alarms else point, f"{abort}, after {cycles:.0f} cycles" if abort else ""


def _watched(plan: DwellPlan, point: Point[object]) -> dict[str, float | None]:
    """Return the monitored quantities of a mean, keyed as in the limits. Of force and displacement, it is the one not held."""
    modal, vibration = point.modal, point.vibration
    amplitude = None if vibration is None else vibration.force_n if plan.level_unit == "m" else vibration.amplitude_m
    return {
        "frequency": None if modal is None else modal.modal_frequency_hz,
        "damping": None if modal is None else modal.damping_ratio,
        "amplitude": amplitude,
    }


def _mode_shape(point: Point[object]) -> float | None:
    return None if point.modal is None else point.modal.drive_mode_shape


def _result(point: Point[object]) -> DwellResult | None:
    return point.result if isinstance(point.result, DwellResult) else None


def _length(point: Point[object]) -> Length:
    """Return the length of a mean; 0 if nothing was recorded."""
    result = _result(point)
    return (None if result is None else result.length) or Length(cycles_in_mean=0.0, seconds_in_mean=0.0)


def _cycles(point: Point[object]) -> float:
    """Return the cycles that a mean has added: those of its record or, if it failed, those until it failed."""
    result = _result(point)
    length = None if result is None else result.length
    return (point.settle_periods or 0.0) if length is None else length.cycles_in_mean


def _beyond(plan: DwellPlan, name: str, changes: Mapping[str, float | None]) -> Iterator[str]:
    """Yield a sentence for each change beyond its limit in the plan's table ``name``."""
    limits = vars(plan.alarm if name == "alarm" else plan.abort)
    for quantity, change in changes.items():
        limit = limits[quantity]
        if limit is not None and change is not None and abs(change) > limit:
            said = "force" if quantity == "amplitude" and plan.level_unit == "m" else quantity
            yield (
                f"the {said} has changed by {100.0 * change:+.3g} % since the first mean, "
                f"{name}.{quantity} is {100.0 * limit:g} %"
            )


@dataclass(frozen=True, eq=False)
class DwellCourse:
    """Ageing of a specimen: float64[n] arrays over the accepted means, each value at the middle of its mean."""

    cycles: NDArray[np.float64]
    """Cycles since the first mean began."""
    time_s: NDArray[np.float64]
    """Seconds since the first mean began, without the settling at the beginning of later parts."""
    frequency_hz: NDArray[np.float64]
    """Frequency at which the phase was held."""
    modal_frequency_hz: NDArray[np.float64]
    """Frequency at exact phase resonance: the held frequency corrected for the remaining phase error."""
    damping_ratio: NDArray[np.float64]
    """Modal damping ratio; NaN if neither plan nor bench has a mode shape of the drive point."""
    amplitude_m: NDArray[np.float64]
    """Displacement amplitude of the drive point, m."""
    force_n: NDArray[np.float64]
    """Fundamental of the force, N."""
    specimen: str
    """Name of the specimen."""


def recorded_course(recording: Recording) -> DwellCourse:
    """Return the accepted means of a recording; raise `identification.IdentificationError` if there are none."""
    points = accepted_points(recording, DwellResult)
    vibrations = [vibration_of(point) for point in points]
    results, modal = [point.result for point in points], [point.modal for point in points]
    return DwellCourse(
        cycles=np.array([None if result is None else result.cycles for result in results], float),
        time_s=np.array([None if result is None else result.time_s for result in results], float),
        frequency_hz=np.array([vibration.frequency_hz for vibration in vibrations], float),
        modal_frequency_hz=np.array([None if one is None else one.modal_frequency_hz for one in modal], float),
        damping_ratio=np.array([None if one is None else one.damping_ratio for one in modal], float),
        amplitude_m=np.array([vibration.amplitude_m for vibration in vibrations], float),
        force_n=np.array([vibration.force_n for vibration in vibrations], float),
        specimen=specimen_of(recording),
    )


def _table(recording: Recording) -> Contents:
    course = vars(recorded_course(recording))
    arrays = {name: values for name, values in course.items() if name != "specimen"}
    return Contents("dwell", course["specimen"], arrays, {"specimen": course["specimen"]}, dict.fromkeys(arrays, 0))


DWELL = Campaign(
    plan=DwellPlan,
    result=DwellResult,
    measure=measure_mean,
    watch=watch_drift,
    columns=DWELL_COLUMNS,
    draw="rig.campaigns.dwell.figure:draw",
    identity=("controller.phase_lag_deg", "mean_s"),
    fixed=("harmonics", "mean_s"),
    measurements={DwellCourse: recorded_course},
    exchanged=lambda recording: [_table(recording)],
)
