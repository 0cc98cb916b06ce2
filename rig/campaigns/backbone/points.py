"""Points of a backbone: their contents, their evaluation from recorded rows, and the backbone made of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification import (
    Backbone,
    IdentificationError,
    ShortPoint,
    SlowFlow,
    short_point,
)
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import (
    first_of,
    nonharmonic_objection,
    phase_objection,
    settled_point,
    std_objection,
    with_settling,
)
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.lost_samples import lost_objection, lost_rows
from rig.campaigns.evaluation.nonharmonic_force import nonharmonic_force
from rig.campaigns.evaluation.point import Lock, Modal, Point, Quality, planned_point
from rig.campaigns.evaluation.recorded import points_of, recorded_drive_shape
from rig.campaigns.evaluation.recorded_flow import SAMPLES_LOST, flagged, recorded_flow
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, quality_warnings, vibration_part
from rig.campaigns.evaluation.vibrations import (
    channels_from,
    measured_with,
    modal_part,
    not_evaluated,
    recorded_vibration,
    vibration_from,
    within_periods,
)
from rig.campaigns.planning.drive_shape import DriveShape, drive_shape
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording
from rig.recording.stored import StoredTable
from rig.text.column import Column

NEAR = 0.1  # a point counts as reached within this distance of its final amplitude, as a logarithm

BACKBONE_COLUMNS = (
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("damping_ratio_std", "+-", "%", ".4f", 196.0, in_line=False, optional=True),
    Column("amplitude_m", "amplitude", "mm", ".4f", 1e3, plain=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class ShortPointResult:
    """Results of a point evaluated by the slow flow, in addition to those of every point. Settled points have none of these."""

    growth_1_s: float
    """Relative rate at which the amplitude still changed, 1/s."""
    measured_force_n: float
    """Fundamental of the force as measured, N."""
    periods_in_all: float
    """Periods of the ramp and of the time at the point, together."""


def measure_backbone_point(
    bench: Bench, plan: BackbonePlan, target: Target, rows: Rows, settling: np.void
) -> Point[object]:
    """Evaluate a recorded point and its quality; ``settling`` is the outcome record of its settle segment.

    A point whose fundamental is too far from the wanted phase is kept but not accepted. For a slow-flow point, the rows begin
    with the ramp to the point.
    """
    if plan.evaluation == "slow-flow":
        return _short_point(bench, plan, target, rows)
    rows = rows[within_periods(rows, plan.record_periods)]
    try:
        vibration = recorded_vibration(
            bench, rows, plan.harmonics, phase_lag_target_deg=plan.controller.phase_lag_deg + 180.0
        )
        modal = modal_part(vibration, drive_shape(bench, plan.plant))
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    point = settled_point(plan, target, bench, vibration, rows)
    return with_settling(replace(point, modal=modal), settling)


def _short_point(bench: Bench, plan: BackbonePlan, target: Target, rows: Rows) -> Point[object]:
    """Evaluate a point from its ramp and the time at the point, whether or not the vibration settled."""
    try:
        flow = recorded_flow(bench, rows, plan.harmonics, plan.plant, other_modes=False)
        found = short_point(flow, start_s=_arrival_s(flow))
        vibration = found.vibration
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=False)
    error_deg = (plan.controller.phase_lag_deg + 180.0 - found.phase_lag_deg + 180.0) % 360.0 - 180.0
    nonharmonic, shape = nonharmonic_force(bench, [rows]), drive_shape(bench, plan.plant)
    reason = _short_objection(plan, found, error_deg, nonharmonic)
    reason = reason or _flagged_objection(bench, rows, flow)
    turned = np.unwrap(rows["theta_rad"].astype(float))
    grown = found.growth_1_s * plan.settle.average_periods / found.modal_frequency_hz
    return replace(
        planned_point(plan, target),
        settled=abs(error_deg) <= plan.settle.phase_deg and abs(grown) <= plan.settle.amplitude,
        reason=reason,
        quality=Quality.of(reason),
        warnings=quality_warnings(bench, vibration, rows, held=False),
        nonharmonic_force=nonharmonic,
        vibration=vibration_part(vibration, rows),
        modal=Modal(
            modal_frequency_hz=found.modal_frequency_hz,
            damping_ratio=found.damping_ratio,
            modal_frequency_std_hz=found.modal_frequency_std_hz,
            damping_ratio_std=shape.damping_std(found.damping_ratio, found.damping_ratio_std),
            **measured_with(shape),
        ),
        lock=Lock(phase_error_deg=error_deg),
        result=ShortPointResult(
            growth_1_s=found.growth_1_s,
            measured_force_n=found.force_n,
            periods_in_all=float(turned[-1] - turned[0]) / (2.0 * math.pi),
        ),
    )


def _flagged_objection(bench: Bench, rows: Rows, flow: SlowFlow) -> str:
    """Object if anything was at a limit at any instant, or too many samples of the whole record were lost."""
    at_limit = {why: at for why, at in flagged(bench, rows, flow).items() if why != SAMPLES_LOST}
    lost = int(np.count_nonzero(lost_rows(rows)))
    return first_of((*(why for why, at in at_limit.items() if at.any()), lost_objection(lost, rows.size)))


def _arrival_s(flow: SlowFlow) -> float:
    """Time from which the amplitude stays near its final value, s."""
    away = np.abs(np.log(flow.amplitude_m / flow.amplitude_m[-1])) > NEAR
    last = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    return float(flow.time_s[min(last, flow.time_s.size - 1)])


def _short_objection(plan: BackbonePlan, found: ShortPoint, error_deg: float, nonharmonic: float) -> str:
    """Return why a slow-flow point is not accepted; an empty string if it is accepted."""
    frequency = found.modal_frequency_std_hz / found.modal_frequency_hz
    damping = found.damping_ratio_std / abs(found.damping_ratio)
    return first_of(
        (
            phase_objection(error_deg, plan.accepted_phase_error_deg),
            std_objection(frequency, plan.accepted_frequency_std, damping, plan.accepted_damping_std),
            nonharmonic_objection(nonharmonic, plan.accepted_nonharmonic_force),
        )
    )


def backbone_of(
    points: Iterable[Point[object]],
    channels: Sequence[StoredTable],
    shape: DriveShape,
    phase_lag_target_deg: float,
) -> Backbone:
    """Return the accepted points of a recording as a backbone; raise `IdentificationError` if no point was accepted."""
    accepted = [point for point in without_repetition(points) if point.accepted]
    IdentificationError.raise_if(not accepted, "none of the recording was accepted", field="points")
    kinds = channels_from(channels)
    vibrations = tuple(vibration_from(point, kinds, phase_lag_target_deg) for point in accepted)
    return shape.backbone(vibrations, [point.direction for point in accepted], [point.repeat for point in accepted])


def recorded_backbone(recording: Recording) -> Backbone:
    """Return the accepted points of the current plan as a backbone, in the order of the plan."""
    points = points_of(recording)
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    return backbone_of(
        points,
        recording.channels,
        recorded_drive_shape(recording, points),
        plan.controller.phase_lag_deg + 180.0,
    )


BACKBONE = Campaign(
    plan=BackbonePlan,
    result=ShortPointResult,
    measure=measure_backbone_point,
    columns=BACKBONE_COLUMNS,
    draw="rig.campaigns.backbone.figure:draw",
    identity=("controller.phase_lag_deg",),
    fixed=("harmonics",),
    measurements={Backbone: recorded_backbone},
    exchanged=lambda recording: [recorded_backbone(recording)],
    experiments="segments",
)
