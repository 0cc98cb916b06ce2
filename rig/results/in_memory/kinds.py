"""Results that have no file of their own: one declaration for each."""

from rig.results.kind import ResultKind

_DRAWN_ELSEWHERE = {
    "spectra": "rig.campaigns.multisine.figure:draw_multisine",
    "tuning": "rig.tuning.figure:draw_on",
    "check": "rig.check.figure:draw_check",
}
"""Addresses of the functions that draw what is not drawn in `rig.results.in_memory.figures`."""

KINDS = tuple(
    ResultKind(
        name=name,
        holds=(holds,),
        stored=False,
        table=f"rig.results.in_memory.tables:say_{word}",
        draw=_DRAWN_ELSEWHERE.get(word, f"rig.results.in_memory.figures:draw_{word}"),
        figure_in=figure_in,
        exchange="rig.results.in_memory.sweep_exchange:EXCHANGE" if word == "transient" else "",
    )
    for name, holds, word, figure_in in (
        ("frequency response", "identification:FrequencyResponse", "response", (9.0, 6.4)),
        ("force surface", "identification:ForceSurface", "surface", (11.0, 4.5)),
        ("curve at constant force", "identification:ConstantForceCurve", "curve", (9.0, 4.0)),
        ("comparison", "identification:Comparison", "comparison", (9.0, 4.0)),
        ("steady prediction", "identification:SteadyPrediction", "prediction", (9.0, 6.0)),
        ("band of responses", "identification:ResponseBand", "band", (9.0, 4.0)),
        ("sweep prediction", "identification:SweepPrediction", "prediction", (9.0, 5.0)),
        ("continuous backbone", "identification:ContinuousBackbone", "continuous", (9.0, 4.0)),
        ("periodic responses", "simulators.analysis:PeriodicResponses", "periodic", (9.0, 4.0)),
        ("distortion levels", "identification:DistortionLevels", "distortion", (9.0, 6.4)),
        ("spectra of a multisine", "identification:PeriodicSpectra", "spectra", (9.0, 6.4)),
        ("stabilisation diagram", "identification:StabilisationDiagram", "stabilisation", (9.0, 4.0)),
        ("sweep", "identification:Transient", "transient", (9.0, 8.0)),
        ("tuning", "rig.tuning:Tuning", "tuning", (11.0, 6.8)),
        ("check", "rig.check.assessment:Assessment", "check", (9.0, 6.4)),
    )
)
"""Every such kind. Of a result that is of two, the first one counts."""
