"""Friction joints: sites with memory."""

from typing import Annotated

from pydantic import Field, model_validator

from simulators.beam import Quantity
from simulators.part import Part, Positive, Several

__all__ = ["JenkinsSite"]


class JenkinsSite(Part):
    """A friction joint: parallel Jenkins elements (Iwan) on one coordinate, minus their stuck linear part.

    The modes of the structure are those with the joint stuck; a stuck joint therefore adds nothing to them.
    """

    at: str
    """Name of the point, or of the relative displacement, that is the joint's coordinate."""
    quantity: Quantity = "deflection"
    """What of the structure there is the joint's coordinate."""
    relative_to_mode_1: bool = False
    """Divide the coordinate by its value in mode 1: it then is a modal coordinate (kg^1/2 m), and stiffnesses are in s^-2."""
    stiffness: Annotated[Several[Positive], Field(min_length=1)]
    """Stiffness of each element, in newtons per unit of the coordinate."""
    slip: Several[Positive]
    """Deflection at which each element slips, in the unit of the coordinate."""

    @model_validator(mode="after")
    def _pairs(self) -> "JenkinsSite":
        if len(self.slip) != len(self.stiffness):
            raise ValueError(f"slip: has {len(self.slip)} values, allowed is {len(self.stiffness)}, one per stiffness")
        return self

    @property
    def stuck_stiffness(self) -> float:
        """Stiffness of the joint while nothing slips."""
        return sum(self.stiffness)
