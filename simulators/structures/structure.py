"""The vibrating structure: a beam or a jointed beam from its geometry, or a structure given by its modes."""

from functools import cached_property, lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from simulators.part import NotNegative, Part, Positive, Several
from simulators.structures.beam import BeamModes, Boundary, Quantity, beam_modes
from simulators.structures.lap_joint import Interface, LapJointModes, LapMesh, Section, lap_joint_modes
from simulators.structures.meshed import MeshedBeam, check_rising
from vibrolock.arrays import Float
from vibrolock.errors import InputError

# A bench, its twins and its variants have the same beam: finite elements are solved once for all of them.
_beam_modes = lru_cache(maxsize=16)(beam_modes)
_lap_joint_modes = lru_cache(maxsize=16)(lap_joint_modes)


class BeamStructure(MeshedBeam):
    """A uniform Euler-Bernoulli beam with lumped masses and supports; its modes come from finite elements."""

    kind: Literal["beam"]
    """This kind of structure."""
    boundary: Boundary = "clamped-free"
    """Condition at position 0 and at the other end: clamped, pinned, guided or free."""
    n_element: Annotated[int, Field(ge=4, le=400)] = 40
    """Number of equal finite elements."""

    @cached_property
    def modes(self) -> BeamModes:
        """Mass-normalised modes of the beam with its lumped masses and supports."""
        area_m2 = self.width_m * self.thickness_m
        return _beam_modes(
            length_m=self.length_m,
            bending_stiffness_n_m2=self.youngs_modulus_pa * area_m2 * self.thickness_m**2 / 12.0,
            mass_per_length_kg_m=self.density_kg_m3 * area_m2,
            n_element=self.n_element,
            n_mode=len(self.damping_ratio),
            boundary=self.boundary,
            lumps=tuple(self.lumps),
            springs=tuple(self.springs),
        )

    def _most_modes(self) -> int:
        held = {"clamped": 2, "pinned": 1, "guided": 1, "free": 0}
        left, right = self.boundary.split("-")
        return 2 * self.n_element + 2 - held[left] - held[right]


class LapJointedBeam(MeshedBeam):
    """Two beams joined by a bolted lap, hung on its supports (the Brake-Reuss beam); modes by finite elements.

    `simulators.structures.lap_joint` has the model. Modes are those of the stuck joint; friction sites take their stiffness
    from it.
    """

    kind: Literal["lap-jointed-beam"]
    """This kind of structure."""
    lap_length_m: Positive
    """Length of the lap, in the middle of the beam."""
    tangential_stiffness_n_m: NotNegative
    """Stiffness of the interface against sliding, all of it."""
    normal_stiffness_n_m: NotNegative
    """Stiffness of the interface against opening, all of it."""
    bolts_m: Annotated[Several[float], Field(min_length=1)]
    """Positions of the bolts along the beam, around which the stiffness is concentrated."""
    bolt_width_m: Positive
    """Standard deviation of the bell-shaped stiffness around each bolt."""
    stiffness_floor: NotNegative = 0.0
    """Stiffness density far from the bolts, as a fraction of that at a bolt."""
    n_arm_element: Annotated[int, Field(ge=2, le=200)] = 10
    """Finite elements in each arm."""
    n_lap_element: Annotated[int, Field(ge=2, le=200)] = 24
    """Finite elements in each leg."""
    sites_m: dict[str, float] = Field(default_factory=dict)
    """Named positions in the lap; their shape is the relative tangential displacement of the legs, a joint's coordinate."""

    @model_validator(mode="after")
    def _lap_fits(self) -> "LapJointedBeam":
        if not self.lap_length_m < self.length_m:
            allowed = f"less than `length_m` = {self.length_m!r}"
            raise InputError(field="lap_length_m", value=self.lap_length_m, allowed=allowed)
        first, last = (self.length_m - self.lap_length_m) / 2.0, (self.length_m + self.lap_length_m) / 2.0
        named = {f"sites_m.{name}": position_m for name, position_m in self.sites_m.items()}
        named |= {f"bolts_m[{index}]": position_m for index, position_m in enumerate(self.bolts_m)}
        for path, position_m in named.items():
            if not first <= position_m <= last:
                raise InputError(field=path, value=position_m, allowed=f"the lap, {first:.6g} to {last:.6g}")
        if twice := sorted(set(self.sites_m) & set(self.points_m)):
            raise InputError("is also in points_m", field=f"sites_m.{twice[0]}", allowed="a name of its own")
        return self

    @cached_property
    def modes(self) -> LapJointModes:
        """Mass-normalised modes of the beam with its joint stuck."""
        return _lap_joint_modes(
            LapMesh(self.length_m, self.lap_length_m, self.thickness_m, self.n_arm_element, self.n_lap_element),
            Section(self.youngs_modulus_pa, self.density_kg_m3, self.width_m, self.thickness_m),
            Interface(
                self.tangential_stiffness_n_m,
                self.normal_stiffness_n_m,
                self.bolts_m,
                self.bolt_width_m,
                self.stiffness_floor,
            ),
            n_mode=len(self.damping_ratio),
            lumps=tuple(self.lumps),
            springs=tuple(self.springs),
        )

    @property
    def points(self) -> tuple[str, ...]:
        """Names with a mode shape: points and friction sites."""
        return (*self.points_m, *self.sites_m)

    def shape(self, at: str, quantity: Quantity = "deflection") -> Float:
        """Mode shapes [n_mode] at a named point, or the relative tangential displacement at a named friction site."""
        if at in self.points_m:
            return self.modes.shape(self.points_m[at], quantity)
        if quantity != "deflection":
            raise InputError(field="quantity", value=quantity, allowed=f"'deflection' at the friction site {at!r}")
        return self.modes.slip(self.sites_m[at])

    def _most_modes(self) -> int:
        return 4 * self.n_arm_element


class ModalStructure(Part):
    """A structure given by its modes, measured or from another program."""

    kind: Literal["modal"]
    """This kind of structure."""
    frequency_hz: Annotated[Several[NotNegative], Field(min_length=1)]
    """Natural frequencies, lowest first, without magnets and with all joints stuck."""
    damping_ratio: Several[Annotated[float, Field(ge=0.0, lt=1.0)]]
    """Viscous modal damping ratios, one per mode."""
    shapes: dict[str, Several[float]]
    """Mass-normalised mode shapes (kg^-1/2) at named points, or of named relative displacements; one value per mode."""

    @model_validator(mode="after")
    def _fits(self) -> "ModalStructure":
        n_mode = len(self.frequency_hz)
        rows = {"damping_ratio": self.damping_ratio} | {f"shapes.{name}": row for name, row in self.shapes.items()}
        for name, row in rows.items():
            if len(row) != n_mode:
                raise InputError(f"has {len(row)} values", field=name, allowed=f"{n_mode}, one per frequency_hz")
        check_rising(self.frequency_hz)
        return self

    @property
    def points(self) -> tuple[str, ...]:
        """Names that a shape may be asked for at."""
        return tuple(self.shapes)

    @property
    def omega_rad_s(self) -> Float:
        """Angular natural frequencies [n_mode]."""
        return 2.0 * np.pi * np.array(self.frequency_hz)

    def shape(self, at: str, quantity: Quantity = "deflection") -> Float:
        """Return the shape [n_mode] given under a name; slopes and curvatures are given as separate shapes."""
        if quantity != "deflection":
            raise InputError(field="quantity", value=quantity, allowed="'deflection' where the modes are given")
        return np.array(self.shapes[at])


Structure = Annotated[BeamStructure | LapJointedBeam | ModalStructure, Field(discriminator="kind")]
"""Any kind of structure."""
