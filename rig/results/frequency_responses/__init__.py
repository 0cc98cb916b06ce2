"""Stepped-sine measurements: frequency responses at several levels."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="frequency-responses",
    holds=("builtins:tuple",),
    storage="rig.results.frequency_responses.views:STORAGE",
    table="rig.results.frequency_responses.views:TABLE",
    draw="rig.results.frequency_responses.views:draw_responses",
    exchange="rig.results.frequency_responses.views:EXCHANGE",
    curves={"frequency responses": "rig.results.frequency_responses.views:curves"},
)
