"""Free decays: modal frequency and damping over the amplitude."""

from rig.results.kind import Identification, ResultKind

KIND = ResultKind(
    name="decay-backbone",
    holds=("identification:DecayBackbone",),
    table="rig.results.decay_backbone.views:TABLE",
    draw="rig.results.decay_backbone.views:draw_decay",
    figure_in=(9.0, 4.0),
    curves={"backbones": "rig.results.decay_backbone.views:curves"},
    identification=Identification(
        "decay",
        "Frequency and damping over the amplitude, from a decay.",
        "rig.results.decay_backbone.options:DecayOptions",
        "rig.results.decay_backbone.identify:identify",
    ),
)
