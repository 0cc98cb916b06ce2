"""The continuous backbone campaign: its declaration, and the backbones in a recording."""

from identification import Backbone, ContinuousBackbone
from rig.campaigns.campaign import Campaign
from rig.campaigns.continuous_backbone.plan import ContinuousBackbonePlan
from rig.campaigns.continuous_backbone.points import (
    CONTINUOUS_BACKBONE_COLUMNS,
    ContinuousBackboneResult,
    continuous_backbones_of,
    measure_continuous_backbone,
)
from rig.campaigns.evaluation.recorded import bench_of_recording, points_of
from rig.recording.reader import Recording

__all__ = ["CONTINUOUS_BACKBONE", "recorded_continuous_backbones", "recorded_mean_backbone"]


def recorded_continuous_backbones(recording: Recording) -> tuple[ContinuousBackbone, ...]:
    """The accepted points, one backbone per repeat, with what was found on the way up and on the way down."""
    specimen = bench_of_recording(recording).specimen
    return continuous_backbones_of(
        points_of(recording, ContinuousBackboneResult), recording.channels, specimen.name, specimen.drive_mode_shape
    )


def recorded_mean_backbone(recording: Recording) -> Backbone:
    """The means of up and down of all repeats, which know nothing of what lay between the two."""
    passes = recorded_continuous_backbones(recording)
    points = [point for one in passes for point in one.backbone.points]
    repeats = [number for number, one in enumerate(passes, 1) for _ in one.backbone.points]
    first = passes[0].backbone
    return Backbone(tuple(points), first.specimen, first.drive_mode_shape, repeats=tuple(repeats))


CONTINUOUS_BACKBONE = Campaign(
    plan=ContinuousBackbonePlan,
    result=ContinuousBackboneResult,
    measure=measure_continuous_backbone,
    in_one_go=True,
    columns=CONTINUOUS_BACKBONE_COLUMNS,
    draw="rig.campaigns.continuous_backbone.figure:draw",
    identity=("controller.phase_lag_deg",),
    fixed=("harmonics",),
    measurements={Backbone: recorded_mean_backbone, ContinuousBackbone: recorded_continuous_backbones},
    exchanged=lambda recording: [recorded_mean_backbone(recording)],
)
