"""Stepped-sine measurements: frequency responses at several levels."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="frequency-responses",
    holds=("builtins:tuple",),
    storage="rig.results.frequency_responses.storage:STORAGE",
    table="rig.results.frequency_responses.table:TABLE",
    draw="rig.results.frequency_responses.figure:draw_responses",
    exchange="rig.results.frequency_responses.exchange:EXCHANGE",
    curves=("frequency responses", "rig.results.frequency_responses.curves:curves"),
)
