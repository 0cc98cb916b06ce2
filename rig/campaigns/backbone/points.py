"""Points of a backbone: their contents, their evaluation from recorded rows, and the backbone made of them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from identification import Backbone, SlowFlow, short_point
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import (
    damping_point,
    nonharmonic_objection,
    phase_objection,
    std_objection,
    with_settling,
)
from rig.campaigns.evaluation.lost_samples import lost_objection, lost_rows
from rig.campaigns.evaluation.nonharmonic_force import nonharmonic_force
from rig.campaigns.evaluation.point import Lock, Modal, Point, Quality, planned_point
from rig.campaigns.evaluation.recorded import settled_backbone
from rig.campaigns.evaluation.recorded_flow import SAMPLES_LOST, flagged, recorded_flow
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import (
    PURITY_COLUMNS,
    damping_bias,
    quality_warnings,
    shared_columns,
    vibration_part,
)
from rig.campaigns.evaluation.vibrations import measured_with, recorded_vibration, within_periods
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording

OTHER_MODES = 0.4
"""Standard error of the receptance of the other modes where no plan tells it, over that of the tested mode at rest (``phi_d^2 /
w^2``). Chosen: on five rigs it was 0.03 to 0.78 of it."""
NEAR = 0.1  # a point counts as reached within this distance of its final amplitude, as a logarithm

BACKBONE_COLUMNS = (
    *shared_columns("force_n", "frequency_hz", "damping_ratio", "damping_ratio_std", "amplitude_m", "phase_error_deg"),
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
    """Evaluate a recorded point and its quality. For a slow-flow point, the rows begin with the ramp to the point."""
    if plan.evaluation == "slow-flow":
        return _short_point(bench, plan, target, rows)
    rows = rows[within_periods(rows, plan.record_periods)]
    vibration = recorded_vibration(bench, rows, plan.harmonics, plan.displacement_lag_deg)
    return with_settling(damping_point(plan, target, bench, vibration, rows), settling)


def _short_point(bench: Bench, plan: BackbonePlan, target: Target, rows: Rows) -> Point[object]:
    flow = recorded_flow(bench, rows, plan.harmonics, plan.plant)
    away = np.abs(np.log(flow.amplitude_m / flow.amplitude_m[-1])) > NEAR
    arrival = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    start_s = float(flow.time_s[min(arrival, flow.time_s.size - 1)])
    found = short_point(flow, start_s=start_s, other_modes=None if plan.plant else _doubted(bench, plan, rows, flow))
    error_deg = (plan.displacement_lag_deg - found.phase_lag_deg + 180.0) % 360.0 - 180.0
    nonharmonic, shape = nonharmonic_force(bench, [rows]), drive_shape(bench, plan.plant)
    lost = int(np.count_nonzero(lost_rows(rows)))
    at_limit = {why: at for why, at in flagged(bench, rows, flow).items() if why != SAMPLES_LOST}
    frequency_std = found.modal_frequency_std_hz / found.modal_frequency_hz
    damping_std = found.damping_ratio_std / abs(found.damping_ratio)
    reason = (
        phase_objection(error_deg, plan.accepted_phase_error_deg)
        or std_objection(frequency_std, plan.accepted_frequency_std, damping_std, plan.accepted_damping_std)
        or nonharmonic_objection(nonharmonic, plan.accepted_nonharmonic_force)
        or next((why for why, at in at_limit.items() if at.any()), "")
        or lost_objection(lost, rows.size)
    )
    turned = np.unwrap(rows["theta_rad"].astype(float))
    grown = found.growth_1_s * plan.settle.average_periods / found.modal_frequency_hz
    return replace(
        planned_point(plan, target),
        settled=abs(error_deg) <= plan.settle.phase_deg and abs(grown) <= plan.settle.amplitude,
        reason=reason,
        quality=Quality.of(reason),
        warnings=(*quality_warnings(bench, found.vibration, rows, held=False), *damping_bias(found.vibration)),
        nonharmonic_force=nonharmonic,
        vibration=vibration_part(found.vibration, rows),
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


def _doubted(bench: Bench, plan: BackbonePlan, rows: Rows, flow: SlowFlow) -> SlowFlow:
    """Return the slow flow with a receptance of the other modes that no plan tells, one standard error from none."""
    omega = 2.0 * math.pi * float(np.median(flow.frequency_hz))
    residual_m_n = OTHER_MODES * (flow.drive_mode_shape / omega) ** 2
    return recorded_flow(bench, rows, plan.harmonics, plan.plant, residual_m_n=residual_m_n)


def recorded_backbone(recording: Recording) -> Backbone:
    """Return the accepted points of the current plan as a backbone, in the order of the plan."""
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    return settled_backbone(recording, plan.displacement_lag_deg)


BACKBONE = Campaign(
    plan=BackbonePlan,
    result=ShortPointResult,
    measure=measure_backbone_point,
    columns=BACKBONE_COLUMNS,
    draw="rig.campaigns.backbone.figure:draw",
    panels=("backbone", "history"),
    asks_for_damping=True,
    identity=("controller.phase_lag_deg",),
    fixed=("harmonics",),
    measurements={Backbone: recorded_backbone},
    exchanged=lambda recording: [recorded_backbone(recording)],
    experiments="segments",
)
