"""A task of the emulated NI-DAQmx, its channels and its attributes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from nidaqmx.constants import AcquisitionType, Coupling, DigitalWidthUnits, ExcitationSource, RegenerationMode
from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.devices import Device, Inputs
from rig.emulator.nidaqmx.errors import NiError
from rig.emulator.nidaqmx.generation import Generation

Value = bool | int | float | str | bytes | list[int] | list[float]
"""The value of an attribute."""


def number(attributes: Mapping[str, Value], name: str, default: float = 0.0) -> float:
    """Return a number among attributes; the default if it has not been set, or is none."""
    value = attributes.get(name, default)
    return float(value) if isinstance(value, int | float) else default


@dataclass
class VirtualChannel:
    """A channel of a task."""

    name: str
    physical: str
    device: Device
    column: int
    """Column of the rig's readings."""
    attributes: dict[str, Value] = field(default_factory=dict)


@dataclass
class Task:
    """A task; one of kind ``ai`` reads, one of kind ``ao`` writes, one of kind ``watchdog`` does neither."""

    name: str
    owner: str
    """Connection of the client that has made it."""
    kind: str = ""
    channels: list[VirtualChannel] = field(default_factory=list)
    attributes: dict[str, Value] = field(default_factory=dict)
    reserved: bool = False
    committed: bool = False
    running: bool = False
    first: int | None = None
    """Sample of the timeline at which it begins; None: it waits for its trigger."""
    position: int = 0
    """Samples read so far."""
    generation: Generation | None = None
    failure: NiError | None = None
    expires_s: float = math.inf

    @property
    def is_timed(self) -> bool:
        """Whether it has a sample clock."""
        return "SAMP_CLK_RATE" in self.attributes

    @property
    def rate_hz(self) -> float:
        """Rate of its sample clock, Hz."""
        return self.number("SAMP_CLK_RATE")

    def number(self, name: str, default: float = 0.0) -> float:
        """Return a number among the attributes."""
        return number(self.attributes, name, default)

    def text(self, name: str) -> str:
        """Return a text attribute, empty if it has not been set."""
        return str(self.attributes.get(name, ""))

    def chosen(self, names: str) -> list[VirtualChannel]:
        """Channels of a list of names with commas; all for an empty one."""
        return [channel for channel in self.channels if not names or channel.name in expanded(names)]

    @property
    def has_run_dry(self) -> bool:
        """Whether its generation has stopped for want of samples."""
        return self.generation is not None and self.generation.has_failed

    def raise_failure(self, written: int | None = None) -> None:
        """Raise what has ended the task, if something has."""
        if self.failure is None and self.has_run_dry:
            self.failure = self.underflow()
        if self.failure is not None:
            raise NiError(self.failure.code, self.failure.reason, written=written)

    def underflow(self) -> NiError:
        """Return the error of a generation that has stopped for want of samples."""
        return NiError(
            DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES,
            f"{self.name} has run out of samples that were written in time",
        )

    @property
    def has_expired(self) -> bool:
        """Whether it is a watchdog that has expired."""
        return self.kind == "watchdog" and self.failure is not None

    @property
    def devices(self) -> list[Device]:
        """Devices of its channels, each once."""
        return list({channel.device.name: channel.device for channel in self.channels}.values())

    def is_on(self, timed_by: str) -> bool:
        """Whether one of its devices is in a chassis."""
        return any(device.timed_by == timed_by for device in self.devices)

    @property
    def inputs(self) -> list[Inputs]:
        """Inputs of its devices."""
        return [device.inputs for device in self.devices if device.inputs is not None]


def expanded(text: str) -> list[str]:
    """Names of a list with commas, in which ``Dev1/ai0:3`` or ``Dev1/ai0:Dev1/ai3`` is a range."""
    names: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        begin, _, end = part.partition(":")
        stem = begin.rstrip("0123456789")
        if not end:
            names.append(part)
            continue
        low, high = int(begin[len(stem) :]), int(end.rpartition("/")[2].lstrip("ao").lstrip("i") or 0)
        names += [f"{stem}{index}" for index in range(low, high + 1)]
    return names


DEFAULTS: dict[str, Value] = {
    "SAMP_QUANT_SAMP_MODE": AcquisitionType.FINITE.value,
    "REGEN_MODE": RegenerationMode.ALLOW_REGENERATION.value,
    "AI_COUPLING": Coupling.DC.value,
    "AI_EXCIT_SRC": ExcitationSource.NONE.value,
    "AI_EXCIT_VAL": 0.0,
    "AI_FILTER_DELAY_UNITS": DigitalWidthUnits.SECONDS.value,
}
"""Attributes that have not been set."""
