"""Backbones that were measured with other systems."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="measured-backbone",
    holds=("identification:Backbone",),
    storage="rig.results.measured_backbone.storage:STORAGE",
    table="rig.results.measured_backbone.table:TABLE",
    draw="rig.results.measured_backbone.figure:draw_backbone",
    exchange="rig.results.measured_backbone.exchange:EXCHANGE",
    curves=("backbones", "rig.results.measured_backbone.curves:curves"),
)
