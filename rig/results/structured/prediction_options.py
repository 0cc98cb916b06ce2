"""Options of predictions by a structured model."""

from typing import ClassVar

from rig.results.simulated.prediction_options import SimulatedPrediction


class StructuredPrediction(SimulatedPrediction):
    """Options of ``rig predict structured``."""

    kind: ClassVar[str] = "structured"
    takes: ClassVar[str] = "a structured model, which answers"

    bands: bool = False
    """Give the responses 95 % bands, from 40 models that the fit allows; takes as long as 40 responses."""
