"""Frequency response matrices, such as imported ones."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="frequency-response-matrix",
    holds=("identification:FrequencyResponseMatrix",),
    table="rig.results.frequency_response_matrix.views:TABLE",
    draw="rig.results.frequency_response_matrix.views:draw_response_matrix",
    exchange="rig.results.frequency_response_matrix.views:EXCHANGE",
    curves={"frequency response functions": "rig.results.frequency_response_matrix.views:curves"},
)
