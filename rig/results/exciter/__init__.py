"""Exciter models."""

from rig.results.kind import Identification, ResultKind

KIND = ResultKind(
    name="exciter",
    holds=("identification:Exciter",),
    table="rig.results.exciter.views:TABLE",
    draw="rig.results.exciter.views:draw_exciter",
    identification=Identification(
        "exciter",
        "Exciter, from one multisine.",
        "rig.results.exciter.options:ExciterOptions",
        "rig.results.exciter.identify:identify",
    ),
)
