"""Settings of an emulator."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.emulator.faults import Faults
from rig.wire.can.frames import DATA_BIT_RATE_HZ, BusTiming
from vibrolock.errors import InputError


class EmulatorSettings(Configured):
    """A virtual bench behind a wire, and how it behaves there."""

    wire: Literal["serial", "can", "sound", "nidaqmx"]
    """The wire protocol it speaks; ``sound``: a sound card, behind a JACK server; ``nidaqmx``: NI devices, behind a server for
    NI's own driver."""
    bench: Bench
    """A bench with the virtual driver: the rig behind the wire."""
    seed: int = Field(0, ge=0)
    """Seed of the rig's noise."""
    lockstep: bool = False
    """Measure a block when its outputs have arrived, instead of by the clock."""
    as_hardware: bool = False
    """Do not report that nothing physical moves, so that arming is asked for as on a real rig."""
    flip: tuple[str, ...] = ()
    """Sensors mounted the other way round."""
    dead: tuple[str, ...] = ()
    """Channels that are not connected."""
    swap: tuple[tuple[str, str], ...] = ()
    """Pairs of sensors in each other's sockets."""
    serial_number: str = Field("0001", max_length=32)
    """Serial number that the device reports."""
    link: Path | None = None
    """Symbolic link to the pseudo-terminal, so that the port has a fixed name."""
    log_output: Path | None = None
    """Log of the device's output, one line per block."""
    interface: str | None = None
    """CAN: interface of python-can, or slcan over a pseudo-terminal if left out."""
    channel: str | None = None
    """CAN: channel of that interface."""
    fd: bool = True
    """CAN: frames of up to 64 bytes."""
    bitrate: int = Field(1_000_000, ge=10_000, le=1_000_000)
    """CAN: bit rate of the bus, bit/s."""
    data_bitrate: int = Field(DATA_BIT_RATE_HZ, ge=1_000_000, le=8_000_000)
    """CAN FD: bit rate within the data, bit/s."""
    node: int = Field(1, ge=0, le=15)
    """CAN: number of the device on its bus."""
    high_pass_hz: tuple[Annotated[float, Field(ge=0, le=100)], ...] = ()
    """Sound: corners of the high-passes of the output and of each input, Hz, or one corner for all; by default there are
    none, so that the bench that reaches the card is right before it is calibrated."""
    cables: bool = False
    """Sound: every input is connected to the output by a cable, as for a calibration, and the rig to nothing."""
    faults: dict[str, Any] = Field(default_factory=dict)
    """Faults of the device; fields of `Faults`. NI devices: errors of NI-DAQmx by call, such as
    ``{"ReadAnalogF64": {"code": -200279, "after": 100}}``, with the fields of `rig.emulator.nidaqmx.faults.Injection`."""
    device_watchdog: bool = False
    """NI devices: the chassis has a watchdog."""
    firmware: Path | None = None
    """Program of the firmware, built for this computer, or its image for ARM, which QEMU runs."""

    @property
    def timing(self) -> BusTiming:
        """CAN: frames and bit rates of the bus."""
        return BusTiming(self.fd, self.bitrate, self.data_bitrate)

    @property
    def simulated(self) -> int:
        """Value of the device's parameter SIMULATED (`rig.wire.messages.Parameter`)."""
        return 0 if self.as_hardware else 2 if self.lockstep else 1

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        unknown = sorted(set(self.faults) - set(asdict(Faults())))
        if unknown and self.wire != "nidaqmx":
            raise InputError(f"{unknown[0]!r}", field="faults", allowed=asdict(Faults()))
        if self.wire == "serial" and self.interface is not None:
            raise InputError("a serial device has none", field="interface", value=self.interface)
        if self.interface not in (None, "slcan") and self.channel is None:
            raise InputError(f"is missing, interface {self.interface!r} has several", field="channel")
        if self.wire == "sound":
            for field in ("lockstep", "as_hardware", "faults", "link", "interface", "firmware"):
                if getattr(self, field):
                    raise InputError("a sound card has none", field=field, value=str(getattr(self, field)))
        else:
            for field in ("high_pass_hz", "cables"):
                if getattr(self, field):
                    raise InputError("is for a sound card", field=field, value=str(getattr(self, field)))
        if self.wire == "nidaqmx":
            for field in ("link", "interface", "firmware"):
                if getattr(self, field):
                    raise InputError("NI devices have none", field=field, value=str(getattr(self, field)))
        if self.firmware is not None and self.faults:
            raise InputError(f"{min(self.faults)!r}: a firmware has none", field="faults", allowed="no fault")
        if self.firmware is not None and self.interface not in (None, "slcan"):
            raise InputError("allowed with a firmware is 'slcan'", field="interface", value=self.interface)
        return self
