"""Options for the identification of a force surface (none), and for predictions by it."""

from typing import Annotated, ClassVar, Literal

from rig.results.options import Option, Options
from rig.results.predictions.options import PredictionOptions


class ForceSurfaceOptions(Options):
    """Options of ``rig identify force-surface``."""

    kind: ClassVar[str] = "force-surface"


class ForceSurfacePrediction(PredictionOptions):
    """Options of ``rig predict force-surface``: it answers between its measured levels, at constant fundamental force."""

    kind: ClassVar[str] = "force-surface"
    takes: ClassVar[str] = "a force surface, which answers"

    held: Annotated[Literal["fundamental"] | None, Option(flag="--force")] = None
    """What is constant: the fundamental."""
