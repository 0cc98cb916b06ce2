"""Results that have no file of their own: one declaration for each."""

from rig.results.kind import ResultKind

_TABLES, _FIGURES = "rig.results.in_memory.tables", "rig.results.in_memory.figures"

KINDS = tuple(
    ResultKind(
        name=name,
        holds=(holds,),
        stored=False,
        table=f"{_TABLES}:{table}",
        draw=draw,
        figure_in=figure_in,
        exchange="rig.results.in_memory.sweep_exchange:EXCHANGE" if name == "sweep" else "",
    )
    for name, holds, table, draw, figure_in in (
        ("frequency response", "identification:FrequencyResponse", "RESPONSE", f"{_FIGURES}:draw_response", (9.0, 6.4)),
        ("force surface", "identification:ForceSurface", "SURFACE", f"{_FIGURES}:draw_surface", (11.0, 4.5)),
        ("curve at constant force", "identification:ConstantForceCurve", "CURVE", f"{_FIGURES}:draw_curve", (9.0, 4.0)),
        ("comparison", "identification:Comparison", "COMPARISON", f"{_FIGURES}:draw_comparison", (9.0, 4.0)),
        (
            "steady prediction",
            "identification:SteadyPrediction",
            "PREDICTION",
            f"{_FIGURES}:draw_prediction",
            (9.0, 6.0),
        ),
        ("band of responses", "identification:ResponseBand", "BAND", f"{_FIGURES}:draw_band", (9.0, 4.0)),
        ("sweep prediction", "identification:SweepPrediction", "PREDICTION", f"{_FIGURES}:draw_prediction", (9.0, 5.0)),
        (
            "continuous backbone",
            "identification:ContinuousBackbone",
            "BACKBONE",
            f"{_FIGURES}:draw_continuous",
            (9.0, 4.0),
        ),
        (
            "periodic responses",
            "simulators.analysis:PeriodicResponses",
            "PERIODIC",
            f"{_FIGURES}:draw_periodic",
            (9.0, 4.0),
        ),
        (
            "distortion levels",
            "identification:DistortionLevels",
            "DISTORTION",
            f"{_FIGURES}:draw_distortion",
            (9.0, 6.4),
        ),
        (
            "spectra of a multisine",
            "identification:PeriodicSpectra",
            "SPECTRA",
            "rig.campaigns.multisine.figure:draw_multisine",
            (9.0, 6.4),
        ),
        (
            "stabilisation diagram",
            "identification:StabilisationDiagram",
            "POLES",
            f"{_FIGURES}:draw_stabilisation",
            (9.0, 4.0),
        ),
        ("sweep", "identification:Transient", "SWEEP", f"{_FIGURES}:draw_transient", (9.0, 8.0)),
        ("tuning", "rig.tuning:Tuning", "TUNING", "rig.tuning.figure:draw_on", (11.0, 6.8)),
        ("check", "rig.check.assessment:Assessment", "CHECK", "rig.check.figure:draw_check", (9.0, 6.4)),
    )
)
"""Every such kind. Of a result that is of two, the first one counts."""
