"""The points of a backbone: what they hold, how they come from recorded rows, and how they make a backbone in memory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification import (
    Backbone,
    IdentificationError,
    ShortPoint,
    SlowFlow,
    nonlinear_mode,
    short_point,
)
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.acceptance import (
    alien_objection,
    first_of,
    phase_objection,
    settled_point,
    std_objection,
    with_settling,
)
from rig.campaigns.evaluation.alien_force import alien_force
from rig.campaigns.evaluation.drift import of_the_result
from rig.campaigns.evaluation.point import Lock, Modal, Point, Quality, planned_point
from rig.campaigns.evaluation.recorded import bench_of_recording, points_of
from rig.campaigns.evaluation.recorded_flow import flagged, recorded_flow
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, quality_warnings, vibration_part
from rig.campaigns.evaluation.vibrations import (
    channels_from,
    modal_part,
    not_evaluated,
    recorded_vibration,
    vibration_from,
    within_periods,
)
from rig.campaigns.planning.plan import Column, Target
from rig.recording.reader import Recording

__all__ = [
    "BACKBONE",
    "BACKBONE_COLUMNS",
    "ShortPointResult",
    "backbone_of",
    "measure_backbone_point",
    "recorded_backbone",
]

NEAR = 0.1  # in the logarithm of the amplitude, of what a point of the slow flow is made

BACKBONE_COLUMNS = (
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("amplitude_m", "amplitude", "mm", ".4f", 1e3, plain=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class ShortPointResult:
    """What a short point has beside the rest. Points that are settled have none."""

    growth_1_s: float
    """Relative rate at which the amplitude still changed, 1/s."""
    measured_force_n: float
    """Fundamental of the force as it was, N."""
    periods_in_all: float
    """Periods of the ramp and of what follows."""


def measure_backbone_point(
    bench: Bench, plan: BackbonePlan, target: Target, rows: np.ndarray, settling: np.void
) -> Point[ShortPointResult]:
    """A recorded point, with its quality; ``settling`` is the outcome record of its settle segment.

    A point whose fundamental is too far from the wanted phase is kept and not accepted. The rows of a short point begin with
    the ramp to it.
    """
    if plan.evaluation == "slow-flow":
        return _short_point(bench, plan, target, rows)
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(
            bench, rows, plan.harmonics, phase_lag_target_deg=plan.controller.phase_lag_deg + 180.0
        )
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    point = settled_point(plan, target, bench, vibration, rows)
    return with_settling(replace(point, modal=modal_part(mode)), settling)


def _short_point(bench: Bench, plan: BackbonePlan, target: Target, rows: np.ndarray) -> Point[ShortPointResult]:
    """A point from the ramp to it and what follows, settled or not."""
    try:
        flow = recorded_flow(bench, rows, plan.harmonics)
        found = short_point(flow, start_s=_arrival_s(flow))
        vibration = found.vibration
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=False)
    error_deg = (plan.controller.phase_lag_deg + 180.0 - found.phase_lag_deg + 180.0) % 360.0 - 180.0
    alien = alien_force(bench, [rows])
    reason = _short_objection(plan, found, error_deg, alien)
    reason = reason or next((why for why, at in flagged(bench, rows, flow).items() if at.any()), "")
    turned = np.unwrap(rows["theta_rad"].astype(float))
    grown = found.growth_1_s * plan.settle.average_periods / found.modal_frequency_hz
    return replace(
        planned_point(plan, target),
        settled=abs(error_deg) <= plan.settle.phase_deg and abs(grown) <= plan.settle.amplitude,
        reason=reason,
        quality=Quality.of(reason),
        warnings=quality_warnings(bench, vibration, rows, held=False),
        alien_force=alien,
        vibration=vibration_part(vibration, rows),
        modal=Modal(
            modal_frequency_hz=found.modal_frequency_hz,
            damping_ratio=found.damping_ratio,
            modal_frequency_std_hz=found.modal_frequency_std_hz,
            damping_ratio_std=found.damping_ratio_std,
        ),
        lock=Lock(phase_error_deg=error_deg),
        result=ShortPointResult(
            growth_1_s=found.growth_1_s,
            measured_force_n=found.force_n,
            periods_in_all=float(turned[-1] - turned[0]) / (2.0 * math.pi),
        ),
    )


def _arrival_s(flow: SlowFlow) -> float:
    """When the amplitude came near to where it ended, for good."""
    away = np.abs(np.log(flow.amplitude_m / flow.amplitude_m[-1])) > NEAR
    last = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    return float(flow.time_s[min(last, flow.time_s.size - 1)])


def _short_objection(plan: BackbonePlan, found: ShortPoint, error_deg: float, alien: float) -> str:
    """Why a point of the slow flow is not accepted; empty where it is."""
    frequency = found.modal_frequency_std_hz / found.modal_frequency_hz
    damping = found.damping_ratio_std / abs(found.damping_ratio)
    return first_of(
        (
            phase_objection(error_deg, plan.accepted_phase_error_deg),
            std_objection(frequency, plan.accepted_frequency_std, damping, plan.accepted_damping_std),
            alien_objection(alien, plan.accepted_alien_force),
        )
    )


def backbone_of(
    points: Iterable[Point[Any]],
    channels: Sequence[Mapping[str, Any]],
    specimen: str,
    drive_mode_shape: float | None,
    phase_lag_target_deg: float,
) -> Backbone:
    """The accepted points of a recording as measurements; raises `IdentificationError` where there is none."""
    accepted = [point for point in of_the_result(points) if point.accepted]
    if not accepted:
        raise IdentificationError("points: none of the recording was accepted")
    kinds = channels_from(channels)
    vibrations = tuple(vibration_from(point, kinds, phase_lag_target_deg) for point in accepted)
    return Backbone(
        vibrations,
        specimen,
        drive_mode_shape,
        tuple(point.direction for point in accepted),
        tuple(point.repeat for point in accepted),
    )


def recorded_backbone(recording: Recording) -> Backbone:
    """The accepted points that the plan asks for, in the order of the plan."""
    bench = bench_of_recording(recording)
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    return backbone_of(
        points_of(recording),
        recording.channels,
        bench.specimen.name,
        bench.specimen.drive_mode_shape,
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
