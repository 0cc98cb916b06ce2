"""Input channels: what is connected to them and how they are scaled."""

import math
from datetime import date
from enum import IntEnum
from typing import TYPE_CHECKING, Self

from pydantic import ConfigDict, Field, model_validator

from rig.bench.configuration import Configured
from vibrolock.data_sheet import volts_per_unit
from vibrolock.errors import InputError

if TYPE_CHECKING:
    from pydantic.json_schema import JsonSchemaValue

UNITS = {"force": "N", "drive": "m/s^2", "response": "m/s^2"}
"""Unit of a channel by its role; a monitor has any."""
LEAST_REMAINDER = 1e-3
"""What is left of 1 less the product of two tangents near a quarter turn, which no single high-pass reaches; chosen."""
DATE = r"^(\d{4}-\d{2}-\d{2})?$"
"""Pattern of a day, or of no day."""
SAME_SENSITIVITY = 1e-5
"""Relative difference up to which two sensitivities are one. Chosen: above rounding to six digits, below any calibration."""
NEGLIGIBLE_BITS = 0.1
"""Amplitude of a harmonic of the force, in steps of the converter, that counts as none. Chosen: below the noise."""


def check_day(name: str, text: str) -> None:
    """Raise `ValueError` for a text of the pattern `DATE` that is no day, such as 2026-02-30."""
    try:
        date.fromisoformat(text or "2000-01-01")
    except ValueError:
        raise InputError(field=name, value=text, allowed="a day as YYYY-MM-DD") from None


class Role(IntEnum):
    """Quantity that a channel measures in the test."""

    FORCE = 0
    """Force at the drive point, by the load cell."""
    DRIVE = 1
    """Acceleration at the drive point; its phase lag behind the force is what the loop controls."""
    RESPONSE = 2
    """Acceleration elsewhere."""
    MONITOR = 3
    """Anything else that is worth a column."""


def _rules(schema: "JsonSchemaValue") -> None:
    """Add to a schema what depends on the role, and the three ways in which a sensitivity is given."""
    schema["required"] = [key for key in schema["required"] if key != "sensitivity_v_per_unit"]
    ways = [{"required": [key]} for key in ("sensitivity_v_per_unit", "sensitivity", "serial_number")]
    any_unit = [{"required": [key]} for key in ("unit", "sensitivity", "serial_number")]
    schema["anyOf"] = ways
    schema["allOf"] = [
        {"if": {"properties": {"role": {"const": role}}}, "then": {"properties": {"unit": {"const": unit}}}}
        for role, unit in UNITS.items()
    ] + [{"if": {"properties": {"role": {"const": "monitor"}}}, "then": {"anyOf": any_unit}}]


class Channel(Configured):
    """An input channel: what is connected to it and how it is scaled."""

    model_config = ConfigDict(json_schema_extra=_rules)

    name: str = Field(min_length=1, pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    """Name, used in files and messages."""
    role: str = Field(
        pattern="^(force|drive|response|monitor)$",
        json_schema_extra={"enum": ["force", "drive", "response", "monitor"]},
    )
    """What it measures: the force at the drive point (``force``), the acceleration there (``drive``) or elsewhere
    (``response``), or anything else (``monitor``)."""
    unit: str = ""
    """Physical unit: N for a force, m/s^2 for drive and response, which need not be given; of a monitor, any."""
    sensitivity_v_per_unit: float = Field(json_schema_extra={"not": {"const": 0}})
    """Volts per unit; negative for a sensor that is mounted the other way round. Follows from ``sensitivity`` where that is
    given."""
    sensitivity: str = ""
    """Sensitivity as on the data sheet, a number and its unit: ``100 mV/g``, ``22.4 mV/N``, ``3.9 pC/N``, ``1 mm/V``."""
    amplifier_gain: str = ""
    """Gain of the amplifier behind a ``sensitivity``: ``10 mV/pC`` of a charge amplifier, which pC need; ``10`` of another."""
    inverted: bool = False
    """Whether the sensor with this ``sensitivity`` is mounted the other way round."""
    range_v: float = Field(10.0, gt=0, le=100)
    """Largest voltage that sensor and converter deliver undistorted, V."""
    resolution_v: float = Field(20.0 / 65536.0, gt=0, le=1)
    """Voltage of the converter's least bit, V."""
    noise_rms: float = Field(0.0, ge=0)
    """Noise of sensor and converter, RMS in the physical unit, as far as known."""
    skew_samples: float = Field(0.0, ge=-100, le=100)
    """Delay of this channel behind the others, samples; taken out of the measured phase lag and of every amplitude."""
    high_pass_hz: float = Field(0.0, ge=0, le=100)
    """Corner of the first-order high-pass of sensor and conditioner, Hz: 0.16 divided by the discharge time constant in
    seconds. Its phase is taken out of the loop's, its gain and phase out of the harmonics of every steady vibration, out of
    multisines and out of sweeps; not out of the samples of settled points that a model is fitted to. 0 for none."""
    input_high_pass_hz: float = Field(0.0, ge=0, le=100)
    """Corner of the first-order high-pass of the device's input, Hz, which audio interfaces have and ``rig calibrate``
    measures; taken out as that of the sensor. 0 for none."""
    anti_alias_hz: float | None = Field(None, ge=0, le=1e6)
    """Corner of the analogue low-pass in front of the converter, Hz; 0 for none. Nothing is corrected by it: a bench that says
    none of its force channel is told that images of the held output may alias onto the force."""
    sensor: str = ""
    """Make and model, for the record."""
    serial_number: str = ""
    """Serial number of the sensor. If the bench's file of sensors has it, what it says of the sensor is taken from there."""
    calibrated: str = Field("", pattern=DATE)
    """Day of its last calibration, YYYY-MM-DD."""
    calibration_due: str = Field("", pattern=DATE)
    """Day from which on that calibration is too old, YYYY-MM-DD; a run that begins later says so."""
    certificate: str = ""
    """Certificate of that calibration, for the record."""
    loopback: bool = False
    """Whether the output itself is connected to this channel, of role ``monitor``: a check then measures the latency."""
    mode_shape: float | None = None
    """Mass-normalised shape of the mode under test at this channel, kg^-1/2; of the sign of ``specimen.drive_mode_shape``
    where it moves with the drive point. A check then tells its polarity, and whether it has been swapped with another; levels
    in metres are checked at this channel too."""

    @model_validator(mode="before")
    @classmethod
    def _from_data_sheet(cls, table: object) -> object:
        """Fill in ``unit`` and ``sensitivity_v_per_unit`` where role and data sheet say them."""
        if not isinstance(table, dict):
            return table
        unit = table.get("unit") or UNITS.get(str(table.get("role")), "")
        sheet, gain, inverted = (table.get(key) for key in ("sensitivity", "amplifier_gain", "inverted"))
        if not sheet and sheet in (None, ""):
            if gain or inverted:
                what = "amplifier_gain" if gain else "inverted"
                raise InputError(
                    field=what, allowed="beside `sensitivity`", hint="sensitivity_v_per_unit holds gain and sign"
                )
            return {**table, "unit": unit}
        if not isinstance(sheet, str) or not isinstance(gain or "", str):
            key, value = ("amplifier_gain", gain) if isinstance(sheet, str) else ("sensitivity", sheet)
            raise InputError(field=key, value=value, allowed="a text with number and unit, such as '100 mV/g'")
        volts, of = volts_per_unit(sheet, gain or "")
        if unit and of != unit:
            raise InputError(
                f"is per {of}, the channel is in {unit}", field="sensitivity", value=sheet, allowed=f"one per {unit}"
            )
        volts = -volts if inverted is True else volts
        given = table.get("sensitivity_v_per_unit", volts)
        if isinstance(given, float) and not math.isclose(given, volts, rel_tol=SAME_SENSITIVITY):
            raise InputError(
                f"sensitivity = {sheet!r} makes it {volts:.6g}",
                field="sensitivity_v_per_unit",
                value=given,
                allowed="one of the two",
            )
        return {**table, "unit": of, "sensitivity_v_per_unit": volts}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.sensitivity_v_per_unit == 0.0:
            raise InputError(field="sensitivity_v_per_unit", value=0, allowed="any number but 0")
        if not self.unit:
            raise InputError(
                "is missing, which a channel with role 'monitor' needs", field="unit", allowed="its physical unit"
            )
        if self.loopback and self.role != "monitor":
            raise InputError(
                field="loopback", allowed=f"a channel with role 'monitor', {self.name!r} has {self.role!r}"
            )
        if self.mode_shape is not None and self.role != "response":
            raise InputError(
                field="mode_shape",
                allowed=f"a channel with role 'response', {self.name!r} has {self.role!r}",
                hint="that of the drive point is specimen.drive_mode_shape",
            )
        for name in ("calibrated", "calibration_due"):
            check_day(name, getattr(self, name))
        wanted = UNITS.get(self.role, self.unit)
        if self.unit != wanted:
            raise InputError(f"a channel with role {self.role!r} is in {wanted!r}", field="unit", value=self.unit)
        return self

    @property
    def range_in_unit(self) -> float:
        """Largest reading in the physical unit."""
        return self.range_v / abs(self.sensitivity_v_per_unit)

    @property
    def resolution_in_unit(self) -> float:
        """Step of the converter in the physical unit."""
        return self.resolution_v / abs(self.sensitivity_v_per_unit)

    def corner_hz(self, frequency_hz: float) -> float:
        """Return the corner, Hz, of one high-pass that leads by as much, at a frequency, as sensor and input together.

        It is the tangent of the sum of two angles; they must be a quarter turn at most, and near one the corner is bounded.
        """
        product = self.high_pass_hz * self.input_high_pass_hz / frequency_hz**2
        return (self.high_pass_hz + self.input_high_pass_hz) / max(1.0 - product, LEAST_REMAINDER)

    @property
    def negligible_amplitude(self) -> float:
        """Amplitude of a harmonic that counts as none, in the physical unit."""
        return NEGLIGIBLE_BITS * self.resolution_in_unit
