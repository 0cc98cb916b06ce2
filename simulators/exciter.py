"""Electrodynamic exciter and the stinger that joins it to the structure."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from simulators.part import NotNegative, Part, Positive
from simulators.shipped import GEOMETRY, shaker_values
from vibrolock.errors import InputError

YOUNGS_MODULUS_PA = {"steel": 200e9, "piano-wire": 190e9, "aluminium": 68.9e9, "nylon": 2.76e9}
"""Young's modulus by material: steel (A36), aluminium (6061-T6) and nylon (6-6) of a textbook's table, 29, 10 and 0.4 million
psi (Multimedia Engineering Mechanics, ecoursesbook.com, appendix Material Properties); piano wire (ASTM A228) 190 GPa
(makeitfrom.com). Both looked up in November 2026. Nylon softens with humidity and temperature."""


def _one_of(schema: dict[str, Any], key: str, instead: tuple[str, ...]) -> None:
    """Ask in a schema for ``key`` or else for the keys ``instead``."""
    schema["required"] = [name for name in schema.get("required", ()) if name not in (key, *instead)]
    schema["oneOf"] = [{"required": [key]}, {"required": [*instead], "not": {"required": [key]}}]


_VALUES = (
    "armature_mass_kg",
    "suspension_stiffness_n_m",
    "suspension_damping_n_s_m",
    "force_factor_n_a",
    "resistance_ohm",
    "inductance_h",
)


class Exciter(Part):
    """Shaker and amplifier: ``m_a v_a' = G(x_a) i - k_a x_a - k_a3 x_a^3 - c_a v_a - F``.

    Voltage amplifier: ``L i' = g u - R i - G(x_a) v_a``. Current amplifier: a first-order loop, ``i' = w_c (g u - i)``,
    whatever the coil's voltage. The force factor acts on force and back-EMF alike, ``G(x_a) = G (1 + b_1 x_a + b_2
    x_a^2)``, so that it moves power and makes none; this and the polynomial suspension are the large-signal model of
    electrodynamic transducers (Klippel 2006, Tutorial: Loudspeaker Nonlinearities, J. Audio Eng. Soc. 54 (10)).

    Not modelled: rotation of the armature, amplifier dynamics beyond these, the coil voltage that limits a current
    amplifier, inductance that changes with position, eddy currents, heating.
    """

    model_config = ConfigDict(json_schema_extra=lambda schema: _one_of(schema, "shaker", _VALUES))

    shaker: str = ""
    """A shaker by its name (`rig list`), whose values the other keys change. Without one, moving mass, suspension, force
    factor, resistance and inductance are given."""
    amplifier: Literal["voltage", "current"] = "voltage"
    """What the amplifier holds at the coil."""
    amplifier_gain: Positive = 1.0
    """Gain g: V/V of a voltage amplifier, A/V of a current amplifier."""
    voltage_limit_v: Positive | None = None
    """Largest voltage of a voltage amplifier, at the coil; beyond, it clips and is flagged."""
    current_limit_a: Positive | None = None
    """Largest current that a current amplifier can be asked for; beyond, it clips and is flagged."""
    bandwidth_hz: Positive = 3000.0
    """Bandwidth w_c/(2 pi) of the loop of a current amplifier."""
    armature_mass_kg: Positive
    """Moving mass m_a."""
    suspension_stiffness_n_m: NotNegative
    """Suspension stiffness k_a."""
    suspension_cubic_n_m3: Annotated[float, Field(ge=0.0, le=1e12)] = 0.0
    """Stiffening of the suspension k_a3."""
    suspension_damping_n_s_m: NotNegative
    """Suspension damping c_a."""
    force_factor_n_a: Positive
    """Force factor G at rest (N/A, the same as V s/m)."""
    droop_per_m: Annotated[float, Field(ge=-1e4, le=1e4)] = 0.0
    """Slope b_1 of the force factor over the armature's position (1/m)."""
    droop_per_m2: Annotated[float, Field(ge=-1e8, le=1e8)] = 0.0
    """Curvature b_2 of the force factor over the armature's position (1/m^2); negative where the coil leaves the gap on
    either side."""
    resistance_ohm: NotNegative
    """Resistance R of coil, cable and amplifier together."""
    inductance_h: Positive
    """Coil inductance L."""

    @model_validator(mode="before")
    @classmethod
    def _from_shaker(cls, table: Any) -> Any:
        if isinstance(table, dict) and isinstance(name := table.get("shaker"), str) and name:
            return {**shaker_values(name), **table}
        return table

    @model_validator(mode="after")
    def _limit_is_the_amplifiers(self) -> "Exciter":
        if self.amplifier == "current" and self.voltage_limit_v is not None:
            allowed = "current_limit_a, it holds a current"
            raise InputError(field="voltage_limit_v", value=self.voltage_limit_v, allowed=allowed)
        if self.amplifier == "voltage" and self.current_limit_a is not None:
            allowed = "voltage_limit_v, it holds a voltage"
            raise InputError(field="current_limit_a", value=self.current_limit_a, allowed=allowed)
        return self

    @property
    def input_limit_v(self) -> float:
        """Voltage at the amplifier's input beyond which it clips; infinite without a limit."""
        limit = self.voltage_limit_v if self.amplifier == "voltage" else self.current_limit_a
        return float("inf") if limit is None else limit / self.amplifier_gain

    @property
    def droops(self) -> bool:
        """True where the force factor depends on position."""
        return self.droop_per_m != 0.0 or self.droop_per_m2 != 0.0

    @property
    def droop_limit_m(self) -> float:
        """Travel of the armature at which the force factor is down to a half, where a run is flagged; infinite if nowhere."""
        roots = np.roots([self.droop_per_m2, self.droop_per_m, 0.5])
        real = [abs(root.real) for root in roots if abs(root.imag) <= 1e-12 * abs(root)]
        return float(min(real, default=np.inf))


class Stinger(Part):
    """The rod between exciter and structure; its force is the measured one: ``F = k_s (x_a - x_d) + c_s (v_a - v_d)``.

    Not modelled: mass, bending and buckling of the rod.
    """

    model_config = ConfigDict(
        json_schema_extra=lambda schema: _one_of(schema, "stiffness_n_m", ("diameter_m", "length_m"))
    )

    at: str
    """Name of the drive point."""
    stiffness_n_m: Positive
    """Axial stiffness k_s. If left out it is EA/L of a round rod of the given material, diameter and length."""
    material: Literal["steel", "piano-wire", "aluminium", "nylon"] | None = None
    """Material of the rod: E = 200 GPa for steel, 190 for piano-wire, 68.9 for aluminium, 2.76 for nylon."""
    youngs_modulus_pa: Positive | None = None
    """Young's modulus E of a rod of another material."""
    diameter_m: Positive | None = None
    """Diameter of the rod."""
    length_m: Positive | None = None
    """Free length L of the rod, between its nuts or chucks."""
    damping_n_s_m: NotNegative
    """Axial damping c_s."""

    @model_validator(mode="before")
    @classmethod
    def _from_geometry(cls, table: Any) -> Any:
        if not isinstance(table, dict) or "stiffness_n_m" in table or not any(table.get(key) for key in GEOMETRY):
            return table
        material, diameter, length = (table.get(key) for key in ("material", "diameter_m", "length_m"))
        modulus = table.get("youngs_modulus_pa") or YOUNGS_MODULUS_PA.get(str(material))
        given = {"diameter_m": diameter, "length_m": length, "material": material or modulus}
        if missing := [key for key, value in given.items() if value is None]:
            reason = "is missing"
            raise InputError(reason, field=missing[0], allowed="stiffness_n_m, or diameter_m, length_m and a material")
        numbers = [value for value in (modulus, diameter, length) if isinstance(value, int | float) and value > 0.0]
        if len(numbers) < 3:
            return table  # the field's own bounds say what is wrong
        return {**table, "stiffness_n_m": numbers[0] * math.pi * numbers[1] ** 2 / 4.0 / numbers[2]}

    @model_validator(mode="after")
    def _one_material(self) -> "Stinger":
        if self.material is not None and self.youngs_modulus_pa is not None:
            raise InputError(field="youngs_modulus_pa", value=self.youngs_modulus_pa, allowed="this or material")
        return self
