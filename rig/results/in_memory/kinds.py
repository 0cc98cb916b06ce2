"""Results that have no file of their own: one declaration for each."""

from rig.results.kind import ResultKind


def _in_memory(
    name: str, holds: str, table: str, draw: str, figure_in: tuple[float, float] = (9.0, 4.0), exchange: str = ""
) -> ResultKind:
    """Declare a kind whose table stands in `rig.results.in_memory.tables`."""
    return ResultKind(
        name=name,
        holds=(holds,),
        stored=False,
        table=f"rig.results.in_memory.tables:{table}",
        draw=draw,
        figure_in=figure_in,
        exchange=exchange,
    )


KINDS = (
    _in_memory(
        "frequency response",
        "identification:FrequencyResponse",
        "RESPONSE",
        "rig.results.in_memory.responses:draw_response",
        (9.0, 6.4),
    ),
    _in_memory(
        "force surface",
        "identification:ForceSurface",
        "SURFACE",
        "rig.results.in_memory.responses:draw_surface",
        (11.0, 4.5),
    ),
    _in_memory(
        "curve at constant force",
        "identification:ConstantForceCurve",
        "CURVE",
        "rig.results.in_memory.responses:draw_constant_force",
    ),
    _in_memory(
        "comparison", "identification:Comparison", "COMPARISON", "rig.results.in_memory.responses:draw_comparison"
    ),
    _in_memory(
        "steady prediction",
        "identification:SteadyPrediction",
        "PREDICTION",
        "rig.results.in_memory.responses:draw_prediction",
        (9.0, 6.0),
    ),
    _in_memory("band of responses", "identification:ResponseBand", "BAND", "rig.results.in_memory.responses:draw_band"),
    _in_memory(
        "sweep prediction",
        "identification:SweepPrediction",
        "PREDICTION",
        "rig.results.in_memory.responses:draw_prediction",
        (9.0, 5.0),
    ),
    _in_memory(
        "continuous backbone",
        "identification:ContinuousBackbone",
        "CONTINUOUS",
        "rig.results.in_memory.backbones:draw_continuous",
    ),
    _in_memory(
        "periodic responses",
        "simulators.analysis:PeriodicResponses",
        "PERIODIC",
        "rig.results.in_memory.backbones:draw_periodic",
    ),
    _in_memory(
        "distortion levels",
        "identification:DistortionLevels",
        "DISTORTION",
        "rig.results.in_memory.spectra:draw_distortion",
        (9.0, 6.4),
    ),
    _in_memory(
        "spectra of a multisine",
        "identification:PeriodicSpectra",
        "SPECTRA",
        "rig.campaigns.multisine.figure:draw_multisine",
        (9.0, 6.4),
    ),
    _in_memory(
        "stabilisation diagram",
        "identification:StabilisationDiagram",
        "STABILISATION",
        "rig.results.in_memory.spectra:draw_stabilisation",
    ),
    _in_memory(
        "sweep",
        "identification:Transient",
        "SWEEP",
        "rig.results.in_memory.spectra:draw_transient",
        (9.0, 8.0),
        "rig.results.in_memory.sweep_exchange:EXCHANGE",
    ),
    _in_memory("tuning", "rig.tuning:Tuning", "TUNING", "rig.tuning.figure:draw_on", (11.0, 6.8)),
    _in_memory("check", "rig.check.assessment:Assessment", "CHECK", "rig.check.figure:draw_check", (9.0, 6.4)),
)
"""Every such kind. Of a result that is of two, the first one counts."""
