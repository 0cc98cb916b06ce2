"""Electrodynamic exciter and the stinger that joins it to the structure."""

from typing import Annotated, Literal

from pydantic import Field

from simulators.part import Part, Positive

__all__ = ["Exciter", "Stinger"]

NotNegative = Annotated[float, Field(ge=0.0)]


class Exciter(Part):
    """Shaker behind a voltage amplifier: ``L i' = u - R i - G v_a``, ``m_a v_a' = G i - k_a x_a - c_a v_a - F``.

    Not modelled: rotation of the armature, droop of the force factor, stiffening of the suspension, amplifier dynamics.
    """

    amplifier: Literal["voltage"] = "voltage"
    """The amplifier holds the voltage at the coil."""
    armature_mass_kg: Positive
    """Moving mass m_a."""
    suspension_stiffness_n_m: NotNegative
    """Suspension stiffness k_a."""
    suspension_damping_n_s_m: NotNegative
    """Suspension damping c_a."""
    force_factor_n_a: Positive
    """Force factor G (N/A, the same as V s/m)."""
    resistance_ohm: NotNegative
    """Resistance R of coil, cable and amplifier together."""
    inductance_h: Positive
    """Coil inductance L."""


class Stinger(Part):
    """The rod between exciter and structure; its force is the measured one: ``F = k_s (x_a - x_d) + c_s (v_a - v_d)``."""

    at: str
    """Name of the drive point."""
    stiffness_n_m: Positive
    """Axial stiffness k_s = EA/L."""
    damping_n_s_m: NotNegative
    """Axial damping c_s."""
