"""Sensors and converters as they are configured."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from simulators.part import Part, Positive

__all__ = ["Converter", "Sensor"]

NotNegative = Annotated[float, Field(ge=0.0)]
Bits = Annotated[int, Field(ge=0, le=32)]


class Sensor(Part):
    """A piezo sensor and its conditioner.

    Not modelled: resonance of the sensor, drift, cross-axis sensitivity, skew between channels.
    """

    name: Annotated[str, Field(min_length=1)]
    """Name of its channel."""
    kind: Literal["force", "acceleration"]
    """Stinger force (N), or acceleration of a point (m/s^2)."""
    at: str | None = None
    """Name of the point whose acceleration it reads; a force sensor reads the stinger."""
    sensitivity_v_per_unit: Annotated[float, Field(gt=0.0)]
    """Sensitivity, V/N or V/(m/s^2)."""
    range_v: Positive
    """Largest voltage it can put out; beyond, it clips and is flagged."""
    noise_rms: NotNegative = 0.0
    """RMS of its white noise, in N or m/s^2."""
    high_pass_hz: NotNegative = 0.3
    """Corner of its first-order high-pass; 0 for none."""

    @model_validator(mode="after")
    def _placed(self) -> "Sensor":
        if self.kind == "acceleration" and self.at is None:
            raise ValueError("at: is missing, an acceleration sensor sits on a named point")
        if self.kind == "force" and self.at is not None:
            raise ValueError(f"at = {self.at!r}: allowed is none, a force sensor reads the stinger")
        return self


class Converter(Part):
    """Sampling, and the converters on either side.

    Not modelled: anti-alias and reconstruction filters, converter noise, queues of a bus (those are the DAQ's).
    """

    sample_rate_hz: Annotated[float, Field(ge=100.0, le=1e6)] = 5000.0
    """Samples per second."""
    substeps: Annotated[int, Field(ge=1, le=64)] = 2
    """Integration steps per sample."""
    adc_bits: Bits = 16
    """Bits of the inputs; 0 for no quantisation."""
    adc_range_v: Positive = 10.0
    """Inputs reach from minus to plus this voltage."""
    dac_bits: Bits = 16
    """Bits of the output; 0 for no quantisation."""
    dac_range_v: Positive = 10.0
    """The output reaches from minus to plus this voltage."""

    @property
    def adc_step_v(self) -> float:
        """Voltage of one input code; 0 without quantisation."""
        return 2.0 * self.adc_range_v / 2.0**self.adc_bits if self.adc_bits else 0.0

    @property
    def dac_step_v(self) -> float:
        """Voltage of one output code; 0 without quantisation."""
        return 2.0 * self.dac_range_v / 2.0**self.dac_bits if self.dac_bits else 0.0
