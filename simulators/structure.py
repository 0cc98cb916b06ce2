"""The vibrating structure: a beam from its geometry, or modes that are given."""

from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simulators.beam import BeamModes, Boundary, Quantity, beam_modes
from simulators.part import Part, Positive, Several

__all__ = ["BeamStructure", "LumpedMass", "ModalStructure", "Structure"]

DampingRatio = Annotated[float, Field(ge=0.0, lt=1.0)]


class LumpedMass(Part):
    """A point mass on a beam: a sensor, a magnet."""

    at: str
    """Name of the point it sits on."""
    mass_kg: Annotated[float, Field(ge=0.0)]
    """Mass."""


class BeamStructure(Part):
    """A uniform Euler-Bernoulli beam with lumped masses; its modes come from finite elements (`simulators.beam`)."""

    kind: Literal["beam"]
    """This kind of structure."""
    length_m: Positive
    """Length; positions count from 0, the clamped end where there is one."""
    width_m: Positive
    """Width of the rectangular section."""
    thickness_m: Positive
    """Thickness of the section, in the direction of vibration."""
    youngs_modulus_pa: Positive
    """Young's modulus."""
    density_kg_m3: Positive
    """Density."""
    boundary: Boundary = "clamped-free"
    """Clamped at 0 and free at the other end, or free at both."""
    n_element: Annotated[int, Field(ge=4, le=400)] = 40
    """Number of equal finite elements."""
    damping_ratio: Annotated[Several[DampingRatio], Field(min_length=1)]
    """Viscous modal damping ratios, lowest mode first; their number is the number of modes kept."""
    points_m: dict[str, float]
    """Named positions along the beam, which sensors, magnets, joints and the stinger refer to."""
    lumped_masses: Several[LumpedMass] = ()
    """Masses on the beam, part of its modes."""

    @model_validator(mode="after")
    def _fits(self) -> "BeamStructure":
        for name, position_m in self.points_m.items():
            if not 0.0 <= position_m <= self.length_m:
                raise ValueError(f"points_m.{name} = {position_m!r}: allowed is 0 to length_m = {self.length_m!r}")
        for index, lumped in enumerate(self.lumped_masses):
            if lumped.at not in self.points_m:
                raise ValueError(f"lumped_masses[{index}].at = {lumped.at!r}: allowed is one of {_list(self.points)}")
        if len(self.damping_ratio) > 2 * self.n_element:
            raise ValueError(
                f"damping_ratio: has {len(self.damping_ratio)} modes, allowed is 1 to {2 * self.n_element}"
            )
        return self

    @property
    def points(self) -> tuple[str, ...]:
        """Names that a shape may be asked for at."""
        return tuple(self.points_m)

    @cached_property
    def modes(self) -> BeamModes:
        """Mass-normalised modes of the beam with its lumped masses."""
        area_m2 = self.width_m * self.thickness_m
        return beam_modes(
            length_m=self.length_m,
            bending_stiffness_n_m2=self.youngs_modulus_pa * area_m2 * self.thickness_m**2 / 12.0,
            mass_per_length_kg_m=self.density_kg_m3 * area_m2,
            n_element=self.n_element,
            n_mode=len(self.damping_ratio),
            boundary=self.boundary,
            lumped=[(self.points_m[mass.at], mass.mass_kg) for mass in self.lumped_masses],
        )

    @property
    def omega_rad_s(self) -> NDArray[np.float64]:
        """Angular natural frequencies [n_mode]."""
        return self.modes.omega_rad_s

    def shape(self, at: str, quantity: Quantity = "deflection") -> NDArray[np.float64]:
        """Mode shapes [n_mode] at a named point."""
        return self.modes.shape(self.points_m[at], quantity)


class ModalStructure(Part):
    """A structure given by its modes, measured or from another program."""

    kind: Literal["modal"]
    """This kind of structure."""
    frequency_hz: Annotated[Several[Annotated[float, Field(ge=0.0)]], Field(min_length=1)]
    """Natural frequencies, lowest first, without magnets and with all joints stuck."""
    damping_ratio: Several[DampingRatio]
    """Viscous modal damping ratios, one per mode."""
    shapes: dict[str, Several[float]]
    """Mass-normalised mode shapes (kg^-1/2) at named points, or of named relative displacements; one value per mode."""

    @model_validator(mode="after")
    def _fits(self) -> "ModalStructure":
        n_mode = len(self.frequency_hz)
        rows = {"damping_ratio": self.damping_ratio} | {f"shapes.{name}": row for name, row in self.shapes.items()}
        for name, row in rows.items():
            if len(row) != n_mode:
                raise ValueError(f"{name}: has {len(row)} values, allowed is {n_mode}, one per frequency_hz")
        return self

    @property
    def points(self) -> tuple[str, ...]:
        """Names that a shape may be asked for at."""
        return tuple(self.shapes)

    @property
    def omega_rad_s(self) -> NDArray[np.float64]:
        """Angular natural frequencies [n_mode]."""
        return 2.0 * np.pi * np.array(self.frequency_hz)

    def shape(self, at: str, quantity: Quantity = "deflection") -> NDArray[np.float64]:
        """The shape [n_mode] given under a name; slopes and curvatures are given as shapes of their own."""
        if quantity != "deflection":
            raise ValueError(f"quantity = {quantity!r}: allowed is 'deflection' where the modes are given")
        return np.array(self.shapes[at])


Structure = Annotated[BeamStructure | ModalStructure, Field(discriminator="kind")]
"""Either kind of structure."""


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(names) or "(no points are named)"
