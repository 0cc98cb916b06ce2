"""Predictions, compared with measurements where there are some."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="predictions",
    holds=("identification:Predictions",),
    table="rig.results.predictions.table:TABLE",
    draw="rig.results.predictions.figure:draw_predictions",
    figure_in=(12.0, 7.0),
    curves={
        "frequency responses": "rig.results.predictions.curves:responses",
        "sweeps": "rig.results.predictions.curves:sweeps",
    },
)
