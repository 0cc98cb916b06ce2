"""Configuration of sensors and converters."""

import math
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from simulators.part import NotNegative, Part, Positive
from vibrolock.data_sheet import volts_per_unit
from vibrolock.described import one_fault
from vibrolock.errors import InputError

TAPS = 6
"""Number of values from which a skewed channel is interpolated."""
LOWEST_INTERNAL_RATE_HZ = 4000.0
"""Lowest internal rate for an anti-alias or reconstruction filter; below, the held output's stairs alias into the readings."""
LOWEST_CORNER = 0.001
"""Lowest corner of a converter's filter over the sample rate; such a filter delays by about six hundred samples."""

FEWEST_SUBSTEPS, MOST_SUBSTEPS = 2, 1024
"""Integration steps per sample: the fewest of ``"auto"``, and the most that can be written."""

Bits = Annotated[int, Field(ge=0, le=32)]
Order = Annotated[int, Field(ge=1, le=8)]


def _either_sensitivity(schema: dict[str, Any]) -> None:
    """Let a schema have the sensitivity of a data sheet in place of that in volts per unit."""
    keys = ("sensitivity_v_per_unit", "sensitivity")
    described = {"type": "string", "description": "Sensitivity as on a data sheet: ``10 mV/g``, ``22.4 mV/N``."}
    schema["properties"]["sensitivity"] = described
    schema["required"] = [key for key in schema["required"] if key not in keys]
    schema["oneOf"] = [{"required": [key]} for key in keys]


class Sensor(Part):
    """A piezo sensor and its conditioner.

    Not modelled: resonance of the sensor, drift, cross-axis sensitivity.
    """

    model_config = ConfigDict(json_schema_extra=_either_sensitivity)

    name: Annotated[str, Field(min_length=1)]
    """Name of its channel."""
    kind: Literal["force", "acceleration"]
    """Stinger force (N), or acceleration of a point (m/s^2)."""
    at: str | None = None
    """Name of the point whose acceleration is measured; a force sensor measures the force of the stinger."""
    sensitivity_v_per_unit: Annotated[float, Field(gt=0.0)]
    """Sensitivity, V/N or V/(m/s^2); or give ``sensitivity`` in its place, as on a data sheet: ``10 mV/g``, ``22.4 mV/N``."""
    range_v: Positive
    """Largest voltage it can put out; beyond, it clips and is flagged."""
    noise_rms: NotNegative = 0.0
    """RMS of its noise in N or m/s^2, white and of this size in the readings, whatever filter stands before them."""
    high_pass_hz: NotNegative = 0.3
    """Corner of its first-order high-pass; 0 for none."""
    low_pass_hz: NotNegative = 0.0
    """Corner of its first-order low-pass; 0 for none."""
    skew_samples: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    """Delay of its readings behind those of the other channels, in samples of the converter."""

    @model_validator(mode="before")
    @classmethod
    def _from_data_sheet(cls, table: object) -> object:
        """Return the table with the sensitivity of a data sheet in volts per unit."""
        if not isinstance(table, dict) or "sensitivity" not in table:
            return table
        text, given = table["sensitivity"], table.get("sensitivity_v_per_unit")
        if not isinstance(text, str) or given is not None:
            allowed = "one of the two" if given is not None else "a text with number and unit, such as '10 mV/g'"
            raise InputError(
                "beside sensitivity_v_per_unit" if given is not None else "",
                field="sensitivity",
                value=text,
                allowed=allowed,
            )
        volts, unit = volts_per_unit(text)
        wanted = "N" if table.get("kind") == "force" else "m/s^2"
        if unit != wanted:
            raise InputError(f"is per {unit}", field="sensitivity", value=text, allowed=f"one per {wanted}")
        return {**{key: one for key, one in table.items() if key != "sensitivity"}, "sensitivity_v_per_unit": volts}

    @model_validator(mode="after")
    def _placed(self) -> "Sensor":
        if self.kind == "acceleration" and self.at is None:
            raise InputError("is missing, an acceleration sensor sits on a named point", field="at")
        if self.kind == "force" and self.at is not None:
            raise InputError(field="at", value=self.at, allowed="none, a force sensor reads the stinger")
        return self


class Converter(Part):
    """Sampling, and the converters on either side.

    With ``oversampling`` the rig runs ``oversampling`` internal instants per sample: filters run at that rate, and one
    instant in so many is converted. Not modelled: queues of a bus (those are the DAQ's), nonlinearity of the converters.
    """

    sample_rate_hz: Annotated[float, Field(ge=100.0, le=1e6)] = 5000.0
    """Samples per second."""
    substeps: Annotated[
        Annotated[int, Field(ge=1, le=MOST_SUBSTEPS)] | Literal["auto"], one_fault(f"1 to {MOST_SUBSTEPS}, or 'auto'")
    ] = "auto"
    """Integration steps per sample; a multiple of ``oversampling``. ``"auto"``: the fewest that the stiffest element allows,
    two or more."""
    oversampling: Annotated[int, Field(ge=1, le=256)] = 1
    """Internal steps per sample, at which sensors and filters run."""
    anti_alias_hz: NotNegative = 0.0
    """Corner of the anti-alias filter of every input, a Butterworth low-pass; 0 for none."""
    anti_alias_order: Order = 6
    """Order of the anti-alias filter. With a corner at 0.4 of the rate, 6 leaves 0.05 % of the images of the output's steps,
    4 leaves 0.25 %."""
    reconstruction_hz: NotNegative = 0.0
    """Corner of the filter that smooths the steps of the output, a Butterworth low-pass; 0 for none."""
    reconstruction_order: Order = 2
    """Order of the filter that smooths the output."""
    adc_bits: Bits = 16
    """Bits of the inputs; 0 for no quantisation."""
    adc_range_v: Positive = 10.0
    """Inputs reach from minus to plus this voltage."""
    adc_noise_v: NotNegative = 0.0
    """RMS of the white noise of each input."""
    dac_bits: Bits = 16
    """Bits of the output; 0 for no quantisation."""
    dac_range_v: Positive = 10.0
    """The output reaches from minus to plus this voltage."""
    dac_noise_v: NotNegative = 0.0
    """RMS of the white noise of the output, one value per sample."""

    @model_validator(mode="after")
    def _fits(self) -> "Converter":
        if self.substeps != "auto" and self.substeps % self.oversampling:
            raise InputError(
                field="substeps", value=self.substeps, allowed=f"a multiple of oversampling = {self.oversampling}"
            )
        if self.anti_alias_hz >= 0.5 * self.sample_rate_hz:
            half_hz = 0.5 * self.sample_rate_hz
            raise InputError(
                field="anti_alias_hz", value=self.anti_alias_hz, allowed=f"below {half_hz:g}, half the rate"
            )
        if self.reconstruction_hz >= 0.5 * self.internal_rate_hz:
            half_hz = 0.5 * self.internal_rate_hz
            allowed = f"below {half_hz:g}, half the internal rate"
            raise InputError(field="reconstruction_hz", value=self.reconstruction_hz, allowed=allowed)
        lowest_hz = LOWEST_CORNER * self.sample_rate_hz
        for name, corner_hz in (("anti_alias_hz", self.anti_alias_hz), ("reconstruction_hz", self.reconstruction_hz)):
            if 0.0 < corner_hz < lowest_hz:
                raise InputError(
                    field=name, value=corner_hz, allowed=f"0, or from {lowest_hz:g} on, {LOWEST_CORNER} of the rate"
                )
        needed = max(2, math.ceil(LOWEST_INTERNAL_RATE_HZ / self.sample_rate_hz))
        if (self.anti_alias_hz or self.reconstruction_hz) and self.oversampling < needed:
            raise InputError(
                field="oversampling",
                value=self.oversampling,
                allowed=f"at least {needed} with a filter, which has to run faster than the converter and at "
                f"{LOWEST_INTERNAL_RATE_HZ:g} Hz or more",
            )
        return self

    @property
    def internal_rate_hz(self) -> float:
        """Rate of sensors and filters."""
        return self.sample_rate_hz * self.oversampling

    def substeps_from(self, fewest: int) -> int:
        """Return the integration steps per sample: those written, else the fewest allowed of which ``fewest`` are enough."""
        if self.substeps != "auto":
            return self.substeps
        per_instant = max(1, math.ceil(max(fewest, FEWEST_SUBSTEPS) / self.oversampling))
        return self.oversampling * min(per_instant, MOST_SUBSTEPS // self.oversampling)

    @property
    def adc_step_v(self) -> float:
        """Voltage of one input code; 0 without quantisation."""
        return 2.0 * self.adc_range_v / 2.0**self.adc_bits if self.adc_bits else 0.0

    @property
    def dac_step_v(self) -> float:
        """Voltage of one output code; 0 without quantisation."""
        return 2.0 * self.dac_range_v / 2.0**self.dac_bits if self.dac_bits else 0.0
