"""Structured models: modes with nonlinear elements between them."""

from rig.results.kind import Identification, Prediction, ResultKind

KIND = ResultKind(
    name="structured",
    holds=(
        "rig.results.structured.model:IdentifiedStructured",
        "identification:StructuredFit",
        "identification:StructuredModel",
    ),
    whole="rig.results.structured.model:whole",
    table="rig.results.structured.table:TABLE",
    draw="rig.results.structured.figure:draw_structured",
    figure_in=(12.0, 7.5),
    exchange="rig.results.structured.exchange:EXCHANGE",
    exported="rig.results.simulated.model:exported",
    curves={"backbones": "rig.results.structured.figure:curves"},
    identification=Identification(
        "structured",
        "Modes with nonlinear elements, fitted over time.",
        "rig.results.structured.options:StructuredOptions",
        "rig.results.structured.identify:identify",
    ),
    prediction=Prediction(
        "Frequency responses, sweeps and multisines.",
        "rig.results.structured.options:StructuredPrediction",
        "rig.results.simulated.predict:predict",
    ),
)
