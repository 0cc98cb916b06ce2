"""Points of a continuous backbone: their contents, their evaluation from rows of ramps, and the backbones made of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from identification import Backbone, Channel, ContinuousBackbone, SlowFlow, continuous_backbone
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.continuous_backbone.plan import ContinuousBackbonePlan
from rig.campaigns.continuous_backbone.ways import WAYS, both_ways, rows_near
from rig.campaigns.evaluation.acceptance import nonharmonic_objection, std_objection
from rig.campaigns.evaluation.measured_together import Passage
from rig.campaigns.evaluation.nonharmonic_force import nonharmonic_force
from rig.campaigns.evaluation.plausibility import with_plausible_ways
from rig.campaigns.evaluation.point import (
    Lock,
    Modal,
    Point,
    Quality,
    planned_point,
    point_name,
    result_of,
    vibration_of,
)
from rig.campaigns.evaluation.recorded import accepted_points, points_of, recorded_drive_shape
from rig.campaigns.evaluation.recorded_flow import recorded_flow
from rig.campaigns.evaluation.vibration_quality import (
    PURITY_COLUMNS,
    damping_bias,
    quality_warnings,
    shared_columns,
    vibration_part,
)
from rig.campaigns.evaluation.vibrations import channels_from, measured_with, vibration_from
from rig.campaigns.planning.drive_shape import DriveShape, drive_shape
from rig.campaigns.planning.plan import Target
from rig.errors import RecordingError
from rig.recording.reader import Recording
from rig.text.column import Column

CONTINUOUS_BACKBONE_COLUMNS = (
    *shared_columns("force_n", "frequency_hz"),
    Column("modal_frequency_std_hz", "+-", "Hz", ".4f", 1.96),
    *shared_columns("damping_ratio"),
    Column("damping_ratio_std", "+-", "%", ".4f", 196.0),
    *shared_columns("amplitude_m"),
    Column("phase_error_deg", "off resonance", "deg", ".1f"),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class OneWay:
    """Modal properties identified at a level from one way."""

    modal_frequency_hz: float
    """Modal frequency, Hz."""
    damping_ratio: float
    """Damping ratio."""
    stiffness: float
    """Modal stiffness, 1/s^2."""
    damping_1_s: float
    """Modal damping, 1/s."""
    stiffness_std: float
    """Standard error of the stiffness, 1/s^2."""
    damping_std_1_s: float
    """Standard error of the damping, 1/s."""


@dataclass(frozen=True, kw_only=True)
class ContinuousBackboneResult:
    """Results at one level in addition to those of every point. The common results of the point are means of both ways."""

    periods_of_both_ways: float
    """Length of both ways together, periods."""
    up: OneWay | None = None
    """Results of the way up; None if it did not pass the level."""
    down: OneWay | None = None
    """Results of the way down; None if it did not pass the level."""


@dataclass(frozen=True, eq=False)
class _Together:
    """Levels that were passed on the same ways, evaluated together."""

    covered: tuple[str, ...]
    """Names of these ways."""
    found: ContinuousBackbone
    """The identified backbone. If there was a single way, it is used in both places."""
    flows: tuple[SlowFlow, ...]
    """The instants of these ways that were used."""
    missing: str
    """Why a way is missing; empty if none is."""


def measure_continuous_backbone(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    targets: Sequence[Target],
    rows: np.ndarray,
    passages: Sequence[Passage],
    ended: str,
) -> list[Point[object]]:
    """Evaluate all levels of a way up and a way down; ``ended`` is the reason why the output was brought down, or empty.

    A level that was passed on one way only gets the results of that way and is not accepted. A level that was not passed at all
    has failed.
    """
    flow = recorded_flow(bench, rows, plan.harmonics, plan.plant)
    ways = both_ways(bench, plan, rows, passages, flow, ended)
    groups: dict[tuple[str, ...], list[Target]] = {}
    for target in targets:
        covered = tuple(name for name in WAYS if ways[name].covers(target.level))
        groups.setdefault(covered, []).append(target)
    out: dict[int, Point[object]] = {}
    for covered, some in groups.items():
        missing = _joined({name: ways[name].why for name in WAYS if name not in covered})
        if not covered:
            for target in some:
                point = replace(planned_point(plan, target), direction="both", settled=False)
                out[target.number] = point.refused(f"not passed: {missing}")
            continue
        flows = [way.flow for way in map(ways.__getitem__, covered) if way.flow is not None]
        levels_m = [target.level for target in some]
        found = continuous_backbone(
            flows[0], flows[-1], levels_m=levels_m, bandwidth=plan.bandwidth, specimen=bench.specimen.name
        )
        together = _Together(covered, found, tuple(flows), missing)
        for index, target in enumerate(some):
            near = [rows_near(bench, rows, ways[name], target.level) for name in covered]
            out[target.number] = _point(bench, plan, target, together, index, near)
    return [out[target.number] for target in targets]


def _joined(reasons: Mapping[str, str]) -> str:
    """Join the reasons of the ways into one line. A reason that both ways share is given once."""
    if len(reasons) == 2 and len(set(reasons.values())) == 1:
        return next(iter(reasons.values()))
    return "; ".join(f"way {name}: {why}" for name, why in reasons.items())


def _point(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    target: Target,
    together: _Together,
    index: int,
    pieces: Sequence[np.ndarray],
) -> Point[object]:
    """Evaluate one level, the ``index``-th of those evaluated together: mean of the ways, with standard errors.

    ``pieces`` are the rows near the level, one array per way.
    """
    covered, found = together.covered, together.found
    mode, vibration = found.nonlinear_mode(), found.backbone.points[index]
    frequency, damping = float(mode.modal_frequency_hz[index]), float(mode.damping_ratio[index])
    # A single way is used in both places, so its noise does not average out.
    single = math.sqrt(2.0) if len(covered) == 1 else 1.0
    frequency_std = single * float(mode.modal_frequency_std_hz[index])
    damping_std, shape = single * float(mode.damping_ratio_std[index]), drive_shape(bench, plan.plant)
    stds = (frequency_std / frequency, damping_std / abs(damping))
    nonharmonic = nonharmonic_force(bench, pieces)
    reason = (
        (f"passed on the way {covered[0]} only ({together.missing})" if together.missing else "")
        or std_objection(stds[0], plan.accepted_frequency_std, stds[1], plan.accepted_damping_std)
        or nonharmonic_objection(nonharmonic, plan.accepted_nonharmonic_force)
    )
    near = np.abs(np.log(np.concatenate([flow.amplitude_m for flow in together.flows]) / target.level)) < plan.bandwidth
    momentary = np.concatenate([flow.frequency_hz for flow in together.flows])[near]
    # The lag oscillates while the level is ramped. Report the lag that a settled vibration at this detuning would have.
    lags = np.degrees(np.arctan((momentary / frequency - 1.0) / abs(damping)))
    ways = {}
    for name in covered:
        place = WAYS.index(name) if len(covered) == 2 else 0, index
        ways[name] = OneWay(**{one.name: float(getattr(found, one.name)[place]) for one in fields(OneWay)})
    rows = np.concatenate(pieces)
    point = replace(
        planned_point(plan, target),
        direction="both" if len(covered) == 2 else "up" if "up" in covered else "down",
        reason=reason,
        quality=Quality.of(reason),
        warnings=(*quality_warnings(bench, vibration, rows, held=False), *damping_bias(vibration)),
        nonharmonic_force=nonharmonic,
        vibration=vibration_part(vibration, rows),
        modal=Modal(
            modal_frequency_hz=frequency,
            damping_ratio=damping,
            modal_frequency_std_hz=frequency_std,
            damping_ratio_std=shape.damping_std(damping, damping_std),
            **measured_with(shape),
        ),
        lock=Lock(phase_error_deg=float(lags[np.argmax(np.abs(lags))]) if lags.size else None),
        result=ContinuousBackboneResult(periods_of_both_ways=found.periods, up=ways.get("up"), down=ways.get("down")),
    )
    return with_plausible_ways(bench, point, pieces)


def _from_points(
    points: Sequence[Point[ContinuousBackboneResult]],
    channels: tuple[Channel, ...],
    shape: DriveShape,
) -> ContinuousBackbone:
    ways = [_both_ways(point) for point in points]

    def property_of(name: str) -> np.ndarray:
        return np.array([[getattr(way, name) for way in both] for both in ways]).T

    # Points of a resumed recording may have been evaluated with another mode shape: the damping goes with its square.
    used = [(None if point.modal is None else point.modal.drive_mode_shape) or shape.fact for point in points]
    times = np.array([((shape.value or 1.0) / (one or shape.value or 1.0)) ** 2 for one in used])
    vibrations = tuple(vibration_from(point, channels) for point in points)
    return ContinuousBackbone(
        backbone=shape.backbone(vibrations),
        amplitude_m=np.array([vibration_of(point).amplitude_m for point in points]),
        stiffness=property_of("stiffness"),
        damping_1_s=times * property_of("damping_1_s"),
        stiffness_std=property_of("stiffness_std"),
        damping_std_1_s=times * property_of("damping_std_1_s"),
        periods=result_of(points[0]).periods_of_both_ways,
    )


def _both_ways(point: Point[ContinuousBackboneResult]) -> tuple[OneWay, OneWay]:
    result = result_of(point)
    if result.up is None or result.down is None:
        raise RecordingError(f"{point_name(point.number)}: is accepted, but holds one way only")
    return result.up, result.down


def recorded_continuous_backbones(recording: Recording) -> tuple[ContinuousBackbone, ...]:
    """Return the accepted points as one backbone per repeat, with the results of the way up and of the way down.

    Raises `IdentificationError` if no point was accepted.
    """
    shape = recorded_drive_shape(recording, points_of(recording))
    repeats: dict[int, list[Point[ContinuousBackboneResult]]] = {}
    for point in accepted_points(recording, ContinuousBackboneResult):
        repeats.setdefault(point.repeat, []).append(point)
    channels = channels_from(recording.channels)
    return tuple(_from_points(accepted, channels, shape) for accepted in repeats.values())


def recorded_mean_backbone(recording: Recording) -> Backbone:
    """Return the means of up and down of all repeats as one backbone, without the differences between up and down."""
    passes = recorded_continuous_backbones(recording)
    points = [point for one in passes for point in one.backbone.points]
    repeats = [number for number, one in enumerate(passes, 1) for _ in one.backbone.points]
    return replace(passes[0].backbone, points=tuple(points), repeats=tuple(repeats))


CONTINUOUS_BACKBONE = Campaign(
    plan=ContinuousBackbonePlan,
    result=ContinuousBackboneResult,
    measure_batch=measure_continuous_backbone,
    columns=CONTINUOUS_BACKBONE_COLUMNS,
    draw="rig.campaigns.continuous_backbone.figure:draw",
    figure_in=(9.0, 9.6),
    asks_for_damping=True,
    identity=("controller.phase_lag_deg",),
    fixed=("harmonics",),
    measurements={Backbone: recorded_mean_backbone, ContinuousBackbone: recorded_continuous_backbones},
    exchanged=lambda recording: [recorded_mean_backbone(recording)],
)
