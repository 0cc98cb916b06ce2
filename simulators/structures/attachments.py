"""What is attached to a beam: sensors and magnets as lumped masses, supports as springs."""

from typing import Annotated

from pydantic import Field, model_validator

from simulators.part import Part

__all__ = ["LumpedMass", "Support"]

NotNegative = Annotated[float, Field(ge=0.0)]


class LumpedMass(Part):
    """A rigid body on a beam: a sensor, a magnet, a bolt."""

    at: str
    """Name of the point it sits on."""
    mass_kg: NotNegative
    """Mass."""
    inertia_kg_m2: NotNegative = 0.0
    """Rotary inertia about its point, for rotation in the plane of vibration."""


class Support(Part):
    """A linear elastic support between a point of a beam and the ground: a bungee cord, a soft clamp."""

    at: str
    """Name of the point that it holds."""
    stiffness_n_m: NotNegative = 0.0
    """Stiffness against deflection."""
    rotational_stiffness_n_m_rad: NotNegative = 0.0
    """Stiffness against rotation, in N m/rad."""

    @model_validator(mode="after")
    def _supports(self) -> "Support":
        if self.stiffness_n_m == 0.0 and self.rotational_stiffness_n_m_rad == 0.0:
            raise ValueError("stiffness_n_m = 0.0 and rotational_stiffness_n_m_rad = 0.0: allowed is one above 0")
        return self
