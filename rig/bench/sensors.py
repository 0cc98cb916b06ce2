"""The file of a laboratory's sensors by serial number, and the channels of a bench that refer to it."""

from calendar import monthrange
from datetime import date
from difflib import get_close_matches
from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from rig.bench.channels import DATE, check_day
from rig.bench.configuration import Configured, Table, read_toml, validated
from rig.errors import ConfigurationError
from vibrolock.data_sheet import volts_per_unit
from vibrolock.errors import InputError
from vibrolock.printable import shown


class Sensor(Configured):
    """A sensor: what its data sheet and its calibration say."""

    serial_number: str = Field(min_length=1)
    """Serial number, by which channels refer to the sensor."""
    make: str = ""
    """Manufacturer."""
    model: str = ""
    """Model."""
    sensitivity: str = Field(min_length=1)
    """Sensitivity as on the data sheet or certificate, a number and its unit: ``100 mV/g``, ``22.4 mV/N``, ``3.9 pC/N``."""
    calibrated: str = Field("", pattern=DATE)
    """Day of the last calibration, YYYY-MM-DD."""
    calibration_due: str = Field("", pattern=DATE)
    """Day from which on that calibration is too old, YYYY-MM-DD."""
    calibration_interval_months: int | None = Field(None, ge=1, le=600)
    """Months after which that calibration is too old, instead of ``calibration_due``."""
    certificate: str = ""
    """Certificate of the calibration: its number, who issued it."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        volts_per_unit(self.sensitivity, "1 V/pC" if "C/" in self.sensitivity else "")  # the amplifier is the channel's
        for name in ("calibrated", "calibration_due"):
            check_day(name, getattr(self, name))
        if self.calibration_interval_months is not None and (self.calibration_due or not self.calibrated):
            raise InputError(
                field="calibration_interval_months",
                value=self.calibration_interval_months,
                allowed="with `calibrated`, and without `calibration_due`",
            )
        if self.calibrated and self.calibration_due and self.calibration_due < self.calibrated:
            raise InputError(
                field="calibration_due",
                value=self.calibration_due,
                allowed=f"a day after calibrated = {self.calibrated!r}",
            )
        return self

    @property
    def due(self) -> str:
        """Day from which on the calibration is too old, YYYY-MM-DD; empty if none is known."""
        if self.calibration_interval_months is None:
            return self.calibration_due
        day = date.fromisoformat(self.calibrated)
        years, month = divmod(day.month - 1 + self.calibration_interval_months, 12)
        year = day.year + years
        return day.replace(year=year, month=month + 1, day=min(day.day, monthrange(year, month + 1)[1])).isoformat()

    def of_channel(self) -> dict[str, str]:
        """Return what a channel with this sensor takes from here."""
        facts = {
            "sensor": f"{self.make} {self.model}".strip(),
            "sensitivity": self.sensitivity,
            "calibrated": self.calibrated,
            "calibration_due": self.due,
            "certificate": self.certificate,
        }
        return {key: value for key, value in facts.items() if value}


class SensorFile(Configured):
    """Sensors of a laboratory, written once; the channels of a bench refer to them by serial number."""

    sensors: tuple[Sensor, ...] = Field(min_length=1)
    """The sensors."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        numbers = [sensor.serial_number for sensor in self.sensors]
        for index, number in enumerate(numbers):
            if number in numbers[:index]:
                raise InputError(
                    "is there twice", field=f"sensors[{index}].serial_number", value=number, allowed="once"
                )
        return self


def with_sensors(table: Table, path: Path) -> Table:
    """Return the table of a bench, its channels completed by the sensors in a file.

    Raises `ConfigurationError` for a channel that says itself what the file says of its sensor, and for one that has no
    sensitivity and a serial number that the file does not have.
    """
    read = validated(SensorFile, read_toml(path), str(path)).sensors
    sensors = {sensor.serial_number: sensor for sensor in read}
    channels = table.get("channels")
    if not isinstance(channels, list):
        return table
    return {**table, "channels": [_completed(one, index, sensors, path) for index, one in enumerate(channels)]}


def _completed(channel: object, index: int, sensors: dict[str, Sensor], path: Path) -> object:
    if not isinstance(channel, dict) or not isinstance(number := channel.get("serial_number", ""), str) or not number:
        return channel
    field = f"channels[{index}].serial_number = {shown(number)}"
    if number not in sensors:
        if "sensitivity" in channel or "sensitivity_v_per_unit" in channel:
            return channel
        close = get_close_matches(number, sensors, n=1)
        hint = f", did you mean {close[0]!r}?" if close else ""
        raise ConfigurationError(
            f"{path.name} has no such sensor{hint}",
            field=field,
            allowed="one of its serial numbers, or a sensitivity here",
        )
    facts = sensors[number].of_channel()
    twice = [key for key in (*facts, "sensitivity_v_per_unit") if channel.get(key)]
    if twice:
        raise ConfigurationError(
            f"{path.name} says it of sensor {number!r}",
            field=f"channels[{index}].{twice[0]}",
            value=channel[twice[0]],
            allowed="one place",
        )
    return {**channel, **facts}
