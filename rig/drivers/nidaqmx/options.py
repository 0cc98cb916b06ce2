"""Options of an NI-DAQmx device in a bench."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from rig.drivers.wire.options import WireOptions
from vibrolock.described import one_fault

Coupling = Literal["", "AC", "DC"]
"""Coupling of an input; empty: as the device has it by default."""
Terminal = Literal["", "differential", "RSE", "NRSE", "pseudodifferential"]
"""Terminal configuration of an input; empty: as the device has it by default."""
Milliamperes = Annotated[float, Field(ge=0, le=20)]
"""Current of an IEPE sensor, mA."""
PHYSICAL = r"^[^/,:]+/[a-z]+[0-9]+$"
"""Pattern of the name of a physical channel: device and channel."""
Physical = Annotated[Annotated[str, Field(pattern=PHYSICAL)], one_fault("device/channel, such as cDAQ1Mod1/ai0")]
"""Name of a physical channel, such as ``cDAQ1Mod1/ai0``."""


class NiDaqmxOptions(WireOptions):
    """Which channels of which NI devices, and how they are wired and clocked; besides the options of all streaming devices."""

    output: Physical
    """Physical channel of the output: ``cDAQ1Mod3/ao0``, ``Dev1/ao0``."""
    inputs: tuple[Physical, ...] = Field(min_length=1)
    """Physical channels of the inputs, in the order of the bench's channels: ``["cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1"]``."""
    coupling: Coupling | tuple[Coupling, ...] = ""
    """Coupling, ``AC`` or ``DC``, of all inputs or one for each; by default the device's."""
    terminal: Terminal | tuple[Terminal, ...] = ""
    """Terminal configuration of all inputs or one for each; by default the device's."""
    excitation_ma: Milliamperes | tuple[Milliamperes, ...] = 0.0
    """Current for IEPE sensors, mA, of all inputs or one for each; 0 for none."""
    buffer_blocks: int | None = Field(None, ge=2, le=4096)
    """Blocks that lie ahead in the device's output buffer, which the driver refills by itself. They delay the loop, and a
    driver that is late for longer stops the output. By default as many as last 10 ms, at least 2."""
    shares: Literal["clock", "timebase"] = "clock"
    """What the output takes from the inputs: their sample clock, or the timebase of which both divide their own clocks, as
    delta-sigma outputs need it (NI 9260)."""
    clock: str = ""
    """Terminal at which the sample clock of inputs and output arrives, such as ``/Dev1/PFI0``; by default the inputs' own."""
    output_clock: str = ""
    """Terminal at which the output's sample clock arrives where a cable brings it, such as ``/Dev2/PFI0``."""
    export_clock: str = ""
    """Terminal on which the inputs' sample clock is sent to another device, such as ``/Dev1/PFI1``."""
    trigger: str = ""
    """Terminal of the start trigger of the inputs; by default they start by themselves."""
    output_trigger: str = ""
    """Terminal of the start trigger of the output, or ``none`` where it starts with the first clock that a cable brings; by
    default the inputs' start trigger."""
    device_watchdog: bool = True
    """Whether the watchdog of the output's device is used where it has one: it sets the output to 0 V when nothing has been
    heard of this computer for ``watchdog_s``."""
    server: str = Field("", pattern=r"^$|^[^\s:/]+:[0-9]{1,5}$")
    """``host:port`` of an NI gRPC Device Server whose devices are used, in place of this computer's."""
    lockstep: bool = False
    """Whether the device waits for the host, as an emulated one can: nothing is continued then."""

    @field_validator("inputs")
    @classmethod
    def _each_once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        doubled = sorted({name for name in value if value.count(name) > 1})
        if doubled:
            raise ValueError(f"channel {doubled[0]} is named twice: allowed is each channel once")
        return value
