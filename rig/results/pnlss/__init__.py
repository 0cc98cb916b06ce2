"""Nonlinear state-space models (PNLSS)."""

from rig.results.kind import Identification, Prediction, ResultKind

KIND = ResultKind(
    name="pnlss",
    holds=(
        "rig.results.pnlss.model:IdentifiedPnlss",
        "identification:PnlssFit",
        "identification:PnlssModel",
    ),
    whole="rig.results.pnlss.model:whole",
    table="rig.results.pnlss.views:TABLE",
    draw="rig.results.pnlss.views:draw_pnlss",
    figure_in=(12.0, 7.5),
    exchange="rig.results.pnlss.exchange:EXCHANGE",
    exported="rig.results.simulated.model:exported",
    identification=Identification(
        "pnlss",
        "Nonlinear state-space model, fitted to signals over time.",
        "rig.results.pnlss.options:PnlssOptions",
        "rig.results.pnlss.identify:identify",
        "rig.results.pnlss.identify:remark",
    ),
    prediction=Prediction(
        "Frequency responses, sweeps and multisines.",
        "rig.results.pnlss.options:PnlssPrediction",
        "rig.results.simulated.predict:predict",
    ),
)
