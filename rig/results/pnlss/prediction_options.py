"""Options of predictions by a PNLSS model."""

from typing import ClassVar

from rig.results.simulated.prediction_options import SimulatedPrediction


class PnlssPrediction(SimulatedPrediction):
    """Options of ``rig predict pnlss``."""

    kind: ClassVar[str] = "pnlss"
    takes: ClassVar[str] = "a PNLSS model, which answers"
