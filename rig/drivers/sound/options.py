"""Options of a sound device in a bench."""

from typing import Annotated

from pydantic import Field, field_validator

from rig.bench.channels import DATE
from rig.drivers.wire.options import WireOptions

Number = Annotated[int, Field(ge=1, le=1024)]
"""Number of a channel of the device, from 1 on."""
Volts = Annotated[float, Field(gt=0, le=1000)]
"""Volts of full scale."""


class SoundOptions(WireOptions):
    """Which sound device, which of its channels, and what they are in volts; besides the options of all streaming devices."""

    device: str | int
    """Name of the device, or a part of it that no other has, or its index; ``rig list --devices`` shows both."""
    host_api: str = ""
    """Host interface, or a part of its name: ``ALSA``, ``JACK``, ``WASAPI``, ``ASIO``, ``Core Audio``. Needed where several
    have a device of this name."""
    output: Number = 1
    """Channel of the output; the device's other outputs get 0 V."""
    inputs: tuple[Number, ...] | None = None
    """Channels of the inputs, in the order of the bench's channels; by default from 1 on."""
    output_full_scale_v: Volts | None = None
    """Peak voltage of the output at full scale, V, with the device's knobs as they are in the test."""
    input_full_scale_v: Volts | tuple[Volts, ...] | None = None
    """Peak voltage of each input at full scale, V, in the order of the bench's channels, or one number for all."""
    device_rate_hz: float | None = Field(None, gt=0, le=1e6)
    """Sample rate of the device, Hz, a whole multiple of the bench's; by default the lowest one that the device has."""
    output_high_pass_hz: float = Field(0.0, ge=0, le=100)
    """Corner of the output's high-pass, Hz, as ``rig calibrate`` has found it; for the record."""
    calibrated: str = Field("", pattern=DATE)
    """Day on which ``rig calibrate`` has measured the channels, YYYY-MM-DD."""
    period_frames: int = Field(128, ge=16, le=8192)
    """Frames that the audio system exchanges at once. Fewer shorten the delay and need a quieter computer. Where a
    block is shorter, ``queue_blocks = "auto"`` takes at least so many that they last for almost two periods."""

    @field_validator("inputs")
    @classmethod
    def _each_once(cls, value: tuple[int, ...] | None) -> tuple[int, ...] | None:
        doubled = sorted({number for number in value or () if (value or ()).count(number) > 1})
        if doubled:
            raise ValueError(f"channel {doubled[0]} is named twice: allowed is each channel once")
        return value
