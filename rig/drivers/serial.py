"""`SerialDAQ`: a device on a serial port."""

from pydantic import Field

from rig.bench import Bench
from rig.bench.configuration import validated
from rig.drivers.wire import LoopOptions, WireDAQ
from rig.wire.serial.link import SerialLink


class SerialOptions(LoopOptions):
    """Port and baud rate, besides the options that all wires share."""

    port: str = Field(min_length=1)
    """Name of the port, such as ``/dev/ttyACM0``; names under ``/dev/serial/by-id`` stay with the device."""
    baud: int = Field(3_000_000, ge=9600, le=12_000_000)
    """Bits per second, 8N1. A USB device that is its own serial port ignores it."""


class SerialDAQ(WireDAQ):
    """A device that speaks the wire protocol over a serial port (``docs/reference/wire-protocol.md``).

    Options: `SerialOptions`. The port is held exclusively while open.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        self._serial_options = validated(SerialOptions, bench.driver.options, "driver.options")
        super().__init__(bench, seed, self._serial_options)

    def _make_link(self) -> SerialLink:
        return SerialLink.port(self._serial_options.port, self._serial_options.baud)
