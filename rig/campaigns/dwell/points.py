"""Means of a dwell: their contents, their evaluation from recorded rows, and changes that raise an alarm or end the test."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from identification import IdentificationError
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.evaluation.acceptance import damping_point, level_error
from rig.campaigns.evaluation.drift import relative_change
from rig.campaigns.evaluation.lost_samples import rms_of_force
from rig.campaigns.evaluation.point import PART, Point
from rig.campaigns.evaluation.recorded import accepted_points, specimen_of
from rig.campaigns.evaluation.rows import Rows, turned_rad
from rig.campaigns.evaluation.stored_point import value_of
from rig.campaigns.evaluation.vibration_quality import FINE_AMPLITUDE, PURITY_COLUMNS, shared_columns
from rig.campaigns.evaluation.vibrations import not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording
from rig.text.column import Column
from rig.text.contents import Contents

DWELL_COLUMNS = (
    Column("cycles", "cycles", "", ".0f"),
    *shared_columns("frequency_hz"),
    Column("frequency_change", "frequency change", "%", "+.3f", 100.0),
    *shared_columns("damping_ratio", "damping_ratio_std"),
    FINE_AMPLITUDE,
    *shared_columns("force_n", "phase_error_deg"),
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
    force_rms_n = rms_of_force(bench, rows)
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics, plan.displacement_lag_deg)
        missed, off_level = level_error(
            plan.amplitude_law, target.level, vibration, force_rms_n, plan.accepted_level_error
        )
        point = damping_point(plan, target, bench, vibration, rows, off_level)
    except (IdentificationError, ArithmeticError) as error:  # its length counts all the same
        return replace(not_evaluated(plan, target, error), result=DwellResult(length=length))
    held = HeldLevel(force_rms_n=force_rms_n, level_error=missed)
    return replace(point, result=DwellResult(length=length, held=held))


def watch_drift(plan: DwellPlan, known: Sequence[Point[object]], point: Point[object]) -> tuple[Point[object], str]:
    """Add cycles, time and changes to a mean; also return why the test ends, or an empty string.

    The changes are relative to the first accepted mean, those of the damping to the first one that was evaluated with the same
    mode shape: a resumed plan may have another. Cycles and seconds refer to the middle of the mean and count from the
    first mean, over all parts of a recording. Failed means count too; the ramp and the settling at the beginning of a part do
    not.
    """
    cycles = sum(map(_cycles, known)) + 0.5 * (value_of(point, "cycles_in_mean") or 0.0)
    seconds = [value_of(one, "seconds_in_mean") or 0.0 for one in (*known, point)]
    result = point.result if isinstance(point.result, DwellResult) else DwellResult()
    result = replace(result, cycles=cycles, time_s=sum(seconds[:-1]) + 0.5 * seconds[-1])
    if not point.accepted:
        return replace(point, result=result), ""
    accepted, shape = [one for one in known if one.accepted], value_of(point, "drive_mode_shape")
    first = next(iter(accepted), point)
    alike = next((one for one in accepted if value_of(one, "drive_mode_shape") == shape), point)
    not_held = "force_n" if plan.level_unit == "m" else "amplitude_m"
    changes = {
        name: relative_change(value_of(before, quantity), value_of(point, quantity))
        for name, before, quantity in (
            ("frequency", first, "modal_frequency_hz"),
            ("damping", alike, "damping_ratio"),
            ("amplitude", first, not_held),
        )
    }
    result = replace(result, changes=Changes(**{f"{name}_change": change for name, change in changes.items()}))
    point = replace(point, result=result)
    alarms = [f"alarm, {text}" for text in _beyond(plan, "alarm", changes)]
    abort = next(_beyond(plan, "abort", changes), "")
    return point.warned(*alarms) if alarms else point, f"{abort}, after {cycles:.0f} cycles" if abort else ""


def _cycles(point: Point[object]) -> float:
    """Return the cycles that a mean has added: those of its record or, if it failed, those until it failed."""
    recorded: float | None = value_of(point, "cycles_in_mean")
    return (point.settle_periods or 0.0) if recorded is None else recorded


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
    names = [one.name for one in fields(DwellCourse) if one.name != "specimen"]
    values = {name: np.array([value_of(point, name) for point in points], float) for name in names}
    return DwellCourse(**values, specimen=specimen_of(recording))


def _table(recording: Recording) -> Contents:
    arrays = dict(vars(recorded_course(recording)))
    specimen = arrays.pop("specimen")
    return Contents("dwell", specimen, arrays, {"specimen": specimen}, dict.fromkeys(arrays, 0))


DWELL = Campaign(
    plan=DwellPlan,
    result=DwellResult,
    measure=measure_mean,
    watch=watch_drift,
    columns=DWELL_COLUMNS,
    draw="rig.campaigns.dwell.figure:draw",
    asks_for_damping=True,
    identity=("controller.phase_lag_deg", "mean_s"),
    fixed=("harmonics", "mean_s"),
    measurements={DwellCourse: recorded_course},
    exchanged=lambda recording: [_table(recording)],
)
