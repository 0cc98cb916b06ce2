"""The backbone campaign: its declaration, and the backbone in a recording."""

from identification import Backbone
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.points import BACKBONE_COLUMNS, ShortPointResult, backbone_of, measure_backbone_point
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.recorded import bench_of_recording, points_of
from rig.recording.reader import Recording

__all__ = ["BACKBONE", "recorded_backbone"]


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
