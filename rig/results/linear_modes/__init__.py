"""Linear modal analyses: the modes, and the responses in which they were identified."""

from rig.results.kind import Identification, ResultKind

KIND = ResultKind(
    name="linear-modes",
    holds=(
        "identification:ModalAnalysis",
        "identification:LinearModes",
    ),
    whole="identification:ModalAnalysis",
    table="rig.results.linear_modes.views:TABLE",
    draw="rig.results.linear_modes.views:draw_linear_modes",
    figure_in=(12.0, 8.0),
    exchange="rig.results.linear_modes.views:EXCHANGE",
    exported="rig.results.linear_modes.views:objects_of",
    curves={"frequency response functions": "rig.results.linear_modes.views:curves"},
    identification=Identification(
        "linear",
        "Linear modes, from multisines, hammer tests or responses.",
        "rig.results.linear_modes.options:LinearOptions",
        "rig.results.linear_modes.identify:identify",
    ),
)
