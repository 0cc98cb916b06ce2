"""Frequency response matrices, such as imported ones."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="frequency-response-matrix",
    holds=("identification:FrequencyResponseMatrix",),
    table="rig.results.frequency_response_matrix.table:TABLE",
    draw="rig.results.frequency_response_matrix.figure:draw_response_matrix",
    exchange="rig.results.frequency_response_matrix.exchange:EXCHANGE",
    curves=("frequency response functions", "rig.results.frequency_response_matrix.curves:curves"),
)
