"""Friction joints: sites with memory, as parallel Jenkins elements (Iwan 1966)."""

from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from simulators.part import Part, Positive, Several
from simulators.structures.beam import Quantity
from vibrolock.errors import InputError
from vibrolock.iwan import iwan_sliders


class _Site(Part):
    """A friction joint on one coordinate, minus its stuck linear part.

    The modes of the structure are those with the joint stuck; a stuck joint therefore adds nothing to them.
    """

    at: str
    """Name of the point, or of the relative displacement, that is the joint's coordinate."""
    quantity: Quantity = "deflection"
    """What of the structure there is the joint's coordinate."""


class JenkinsSite(_Site):
    """A friction joint of Jenkins elements that are given one by one."""

    kind: Literal["jenkins"]
    """This kind of joint."""
    relative_to_mode_1: bool = False
    """Divide the coordinate by its value in mode 1: it then is a modal coordinate (kg^1/2 m), and stiffnesses are in s^-2."""
    stiffness: Annotated[Several[Positive], Field(min_length=1)]
    """Stiffness of each element, in newtons per unit of the coordinate."""
    slip: Several[Positive]
    """Deflection at which each element slips, in the unit of the coordinate."""

    @model_validator(mode="after")
    def _pairs(self) -> "JenkinsSite":
        if len(self.slip) != len(self.stiffness):
            reason = f"has {len(self.slip)} values"
            raise InputError(reason, field="slip", allowed=f"{len(self.stiffness)}, one per stiffness")
        return self

    @property
    def stuck_stiffness(self) -> float:
        """Stiffness of the joint while nothing slips."""
        return sum(self.stiffness)


class IwanSite(_Site):
    """Segalman's four-parameter Iwan joint (J. Appl. Mech. 72, 2005, 752), cut into Jenkins elements and an end slider.

    Stiffness density over slip deflection: ``rho(phi) = R phi^chi`` up to phi_max, and there a slider of stiffness S, with
    ``beta = S / (R phi_max^(chi+1) / (chi+1))``. In micro-slip the energy lost a cycle grows with amplitude^(3+chi).

    The density is cut at 0, at ``first_bin`` phi_max and from there geometrically up to phi_max. Each element has the
    stiffness of its bin and slips at the bin's mean slip deflection, so that stuck stiffness and force at full slip are
    exact. With amplitudes below the first bin's slip nothing is lost.
    """

    kind: Literal["iwan"]
    """This kind of joint."""
    stiffness_n_m: Positive
    """Stuck stiffness K_T."""
    phi_max_m: Positive
    """Deflection phi_max of full slip."""
    chi: Annotated[float, Field(gt=-1.0, le=2.0)]
    """Exponent of the density."""
    beta: Annotated[float, Field(ge=0.0)]
    """Stiffness of the end slider over that of the whole density."""
    n_element: Annotated[int, Field(ge=1, le=63)] = 8
    """Jenkins elements beside the end slider; fewer than about eight make the damping curve jagged."""
    first_bin: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.02
    """Upper end of the first bin, as a fraction of phi_max."""

    relative_to_mode_1: ClassVar[bool] = False

    @cached_property
    def _elements(self) -> np.ndarray:
        """Stiffness (N/m) and slip deflection (m) [2, n_element + 1], the end slider last where there is one."""
        ends = np.geomspace(self.first_bin, 1.0, self.n_element) if self.n_element > 1 else np.ones(1)
        stiffness, slip = iwan_sliders(self.stiffness_n_m, self.chi, self.beta, np.concatenate([[0.0], ends]))
        elements = np.array([stiffness, self.phi_max_m * slip])
        return elements if self.beta > 0.0 else elements[:, :-1]

    @property
    def stiffness(self) -> tuple[float, ...]:
        """Stiffness (N/m) of each element."""
        return tuple(self._elements[0].tolist())

    @property
    def slip(self) -> tuple[float, ...]:
        """Deflection (m) at which each element slips."""
        return tuple(self._elements[1].tolist())

    @property
    def stuck_stiffness(self) -> float:
        """Stiffness of the joint while nothing slips."""
        return self.stiffness_n_m

    @property
    def full_slip_force_n(self) -> float:
        """Force at full slip: ``K_T phi_max ((chi+1)/(chi+2) + beta) / (1 + beta)`` (Segalman, in these parameters)."""
        share = ((self.chi + 1.0) / (self.chi + 2.0) + self.beta) / (1.0 + self.beta)
        return self.stiffness_n_m * self.phi_max_m * share


FrictionSite = Annotated[JenkinsSite | IwanSite, Field(discriminator="kind")]
"""Either kind of friction joint."""
