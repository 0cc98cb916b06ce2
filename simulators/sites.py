"""Local nonlinear sites: magnets and friction joints."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from simulators.beam import Quantity
from simulators.part import Part, Positive, Several

__all__ = ["JenkinsSite", "Magnet"]

VALID_SHARE_OF_GAP = 0.7


class Magnet(Part):
    """A magnet on the structure facing a fixed one, or two fixed ones on either side (Scheel et al.).

    Force at deflection z from the installed equilibrium: ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 +
    K0/(d0+z)^4`` symmetric. Valid for ``|z| < 0.7 d0``.
    """

    kind: Literal["one_sided", "symmetric"]
    """One fixed magnet, or a pair on either side."""
    at: str
    """Name of the point it sits on."""
    strength_n_m4: Positive
    """Magnet constant K0 (N m^4)."""
    gap_m: Positive
    """Gap d0 at rest."""

    @property
    def stiffness_n_m(self) -> float:
        """Linear part, ``4 K0/d0^5`` one-sided and ``8 K0/d0^5`` symmetric; it belongs to the linear plant."""
        return (4.0 if self.kind == "one_sided" else 8.0) * self.strength_n_m4 / self.gap_m**5

    @property
    def limit_m(self) -> float:
        """Largest deflection for which the force law holds."""
        return VALID_SHARE_OF_GAP * self.gap_m


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
