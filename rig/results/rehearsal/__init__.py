"""Rehearsals: a plan on many virtual twins."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="rehearsal",
    holds=("rig.rehearsal.rehearsal:Rehearsal",),
    storage="rig.results.rehearsal.views:STORAGE",
    table="rig.results.rehearsal.views:TABLE",
    draw="rig.rehearsal.figure:draw_rehearsal",
    figure_in=(12.0, 8.4),
)
