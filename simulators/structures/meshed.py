"""Beams given by their geometry: material, section, named points, lumped masses, supports, damping."""

from abc import abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Protocol

import numpy as np
from pydantic import Field, model_validator

from simulators.part import NotNegative, Part, Positive, Several
from simulators.structures.beam import Lump, Quantity, Spring
from vibrolock.arrays import Float
from vibrolock.errors import InputError


class LumpedMass(Part):
    """A rigid body on a beam: a sensor, a magnet, a bolt."""

    at: str
    """Name of the point it sits on."""
    mass_kg: NotNegative
    """Mass at the point."""
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


class Modes(Protocol):
    """Mass-normalised modes that can be read anywhere along a beam."""

    @property
    def omega_rad_s(self) -> Float:
        """Angular natural frequencies [n_mode]."""

    def shape(self, position_m: float, quantity: Quantity = "deflection") -> Float:
        """Mode shapes [n_mode] at a position."""


class MeshedBeam(Part):
    """A beam of rectangular section; subclasses define its parts and compute its `modes`."""

    length_m: Positive
    """Length; positions count from 0, the clamped end where there is one."""
    width_m: Positive
    """Width of the rectangular section."""
    thickness_m: Positive
    """Thickness of the section, in the direction of vibration."""
    youngs_modulus_pa: Positive
    """Young's modulus."""
    density_kg_m3: Positive
    """Density of the material."""
    damping_ratio: Annotated[Several[Annotated[float, Field(ge=0.0, lt=1.0)]], Field(min_length=1)]
    """Viscous modal damping ratios, lowest mode first; their number is the number of modes kept."""
    frequency_hz: Several[Positive] | None = None
    """Measured frequencies that replace the computed ones, lowest first, one per mode kept; the shapes stay as computed."""
    points_m: dict[str, float]
    """Named positions along the beam, which sensors, magnets, joints and the stinger refer to."""
    lumped_masses: Several[LumpedMass] = ()
    """Masses on the beam, part of its modes."""
    supports: Several[Support] = ()
    """Springs between points of the beam and the ground."""

    @model_validator(mode="after")
    def _fits(self) -> "MeshedBeam":
        for name, position_m in self.points_m.items():
            if not 0.0 <= position_m <= self.length_m:
                raise InputError(
                    field=f"points_m.{name}", value=position_m, allowed=f"0 to length_m = {self.length_m!r}"
                )
        attached = {f"lumped_masses[{index}]": lumped.at for index, lumped in enumerate(self.lumped_masses)}
        attached |= {f"supports[{index}]": support.at for index, support in enumerate(self.supports)}
        for path, at in attached.items():
            if at not in self.points_m:
                allowed = ", ".join(self.points_m) or "(no points are named)"
                raise InputError(field=f"{path}.at", value=at, allowed=f"one of {allowed}")
        n_mode, most = len(self.damping_ratio), self._most_modes()
        InputError.raise_if(n_mode > most, f"has {n_mode} modes", field="damping_ratio", allowed=f"1 to {most}")
        if self.frequency_hz is not None and len(self.frequency_hz) != n_mode:
            reason = f"has {len(self.frequency_hz)} values"
            raise InputError(reason, field="frequency_hz", allowed=f"{n_mode}, one per damping_ratio")
        check_rising(self.frequency_hz or ())
        return self

    @property
    @abstractmethod
    def modes(self) -> Modes:
        """Mass-normalised modes from the geometry, with computed frequencies."""

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points with a mode shape."""
        return tuple(self.points_m)

    @property
    def lumps(self) -> list[Lump]:
        """Return the lumped masses with their positions."""
        return [Lump(self.points_m[one.at], one.mass_kg, one.inertia_kg_m2) for one in self.lumped_masses]

    @property
    def springs(self) -> list[Spring]:
        """Return the supports with their positions."""
        return [
            Spring(self.points_m[one.at], one.stiffness_n_m, one.rotational_stiffness_n_m_rad) for one in self.supports
        ]

    @property
    def omega_rad_s(self) -> Float:
        """Angular natural frequencies [n_mode]; the measured ones if given."""
        return self.modes.omega_rad_s if self.frequency_hz is None else 2.0 * np.pi * np.array(self.frequency_hz)

    def shape(self, at: str, quantity: Quantity = "deflection") -> Float:
        """Mode shapes [n_mode] at a named point."""
        return self.modes.shape(self.points_m[at], quantity)

    @abstractmethod
    def _most_modes(self) -> int:
        """Return the largest number of modes of the mesh."""


def check_rising(frequencies_hz: Sequence[float]) -> None:
    """Raise `ValueError` if frequencies do not rise, because shapes and damping would then belong to other modes."""
    for index, (before_hz, next_hz) in enumerate(pairwise(frequencies_hz), start=1):
        if next_hz < before_hz:
            allowed = f"from {before_hz:g} on, lowest first"
            raise InputError(field=f"frequency_hz[{index}]", value=next_hz, allowed=allowed)
