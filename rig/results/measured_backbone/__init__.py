"""Backbones that were measured with other systems."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="measured-backbone",
    holds=("identification:Backbone",),
    storage="rig.results.measured_backbone.views:STORAGE",
    table="rig.results.measured_backbone.views:TABLE",
    draw="rig.results.measured_backbone.views:draw_backbone",
    exchange="rig.results.measured_backbone.views:EXCHANGE",
    curves={"backbones": "rig.results.measured_backbone.views:curves"},
)
