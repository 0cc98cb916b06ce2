"""Input channels: what is connected to them and how they are scaled."""

from datetime import date
from enum import IntEnum
from typing import Self

from pydantic import ConfigDict, Field, model_validator

from rig.bench.configuration import Configured

__all__ = ["Channel", "Role"]

UNITS = {"force": "N", "drive": "m/s^2", "response": "m/s^2"}
"""Unit of a channel by its role; a monitor has any."""
DATE = r"^(\d{4}-\d{2}-\d{2})?$"


def _check_day(name: str, text: str) -> None:
    try:
        date.fromisoformat(text or "2000-01-01")
    except ValueError:
        raise ValueError(f"{name} = {text!r}: allowed is a day as YYYY-MM-DD") from None


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


class Channel(Configured):
    """An input channel: what is connected to it and how it is scaled."""

    model_config = ConfigDict(
        json_schema_extra={
            "allOf": [
                {"if": {"properties": {"role": {"const": role}}}, "then": {"properties": {"unit": {"const": unit}}}}
                for role, unit in UNITS.items()
            ]
        }
    )

    name: str = Field(min_length=1, pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    """Name, used in files and messages."""
    role: str = Field(
        pattern="^(force|drive|response|monitor)$",
        json_schema_extra={"enum": ["force", "drive", "response", "monitor"]},
    )
    """What it measures: the force at the drive point (``force``), the acceleration there (``drive``) or elsewhere
    (``response``), or anything else (``monitor``)."""
    unit: str
    """Physical unit: N for a force, m/s^2 for drive and response."""
    sensitivity_v_per_unit: float = Field(json_schema_extra={"not": {"const": 0}})
    """Volts per unit; negative for a sensor that is mounted the other way round."""
    range_v: float = Field(10.0, gt=0, le=100)
    """Largest voltage that sensor and converter deliver undistorted, V."""
    resolution_v: float = Field(20.0 / 65536.0, gt=0, le=1)
    """Voltage of the converter's least bit, V."""
    noise_rms: float = Field(0.0, ge=0)
    """Noise of sensor and converter, RMS in the physical unit, as far as known."""
    skew_samples: float = Field(0.0, ge=-100, le=100)
    """Delay of this channel behind the others, samples; taken out of the measured phase lag and of every amplitude."""
    sensor: str = ""
    """Type, for the record."""
    serial_number: str = ""
    """Serial number of the sensor, for the record."""
    calibrated: str = Field("", pattern=DATE)
    """Day of its last calibration, YYYY-MM-DD."""
    calibration_due: str = Field("", pattern=DATE)
    """Day from which on that calibration is too old, YYYY-MM-DD; a run that begins later says so."""
    loopback: bool = False
    """Whether the output itself is connected to this channel, of role ``monitor``: a check then measures the latency."""
    mode_shape: float | None = None
    """Mass-normalised shape of the mode under test at this channel, kg^-1/2; of the sign of ``specimen.drive_mode_shape``
    where it moves with the drive point. A check then tells its polarity, and whether it has been swapped with another; levels
    in metres are checked at this channel too."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.sensitivity_v_per_unit == 0.0:
            raise ValueError("sensitivity_v_per_unit = 0: allowed is any number but 0")
        if self.loopback and self.role != "monitor":
            raise ValueError(f"loopback: allowed is a channel with role 'monitor', {self.name!r} has {self.role!r}")
        if self.mode_shape is not None and self.role != "response":
            raise ValueError(
                f"mode_shape: allowed is a channel with role 'response', {self.name!r} has {self.role!r}; that of the drive "
                "point is specimen.drive_mode_shape"
            )
        for name in ("calibrated", "calibration_due"):
            _check_day(name, getattr(self, name))
        wanted = UNITS.get(self.role, self.unit)
        if self.unit != wanted:
            raise ValueError(f"unit = {self.unit!r}: a channel with role {self.role!r} is in {wanted!r}")
        return self

    @property
    def role_code(self) -> Role:
        """The role as an integer code for the kernels."""
        return Role[self.role.upper()]

    @property
    def range_in_unit(self) -> float:
        """Largest reading in the physical unit."""
        return self.range_v / abs(self.sensitivity_v_per_unit)
