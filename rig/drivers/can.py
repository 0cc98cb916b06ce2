"""`CanDAQ`: a device on a CAN bus."""

from pydantic import Field

from rig.bench import Bench
from rig.bench.configuration import Table, validated
from rig.drivers.wire import LoopOptions, WireDAQ
from rig.wire.can.bus import FrameBus, PythonCanBus
from rig.wire.can.frames import DATA_BIT_RATE_HZ, BusTiming
from rig.wire.can.link import CanLink
from rig.wire.can.slcan import SlcanBus
from rig.wire.link import Link


class CanOptions(LoopOptions):
    """Where the bus is, how fast it is, and which node the device has."""

    interface: str = Field("socketcan", min_length=1)
    """A backend of python-can by its name, or ``slcan``: an adapter on a serial line, which needs no backend."""
    channel: str | int
    """The interface's name, for instance ``can0``; with ``slcan`` the serial port."""
    fd: bool = True
    """CAN FD, or classical CAN."""
    bitrate: int = Field(1_000_000, ge=10_000, le=1_000_000)
    """Bit rate of the bus, bit/s; ``slcan`` has 10000, 20000, 50000, 100000, 125000, 250000, 500000, 750000 and 1000000."""
    data_bitrate: int = Field(DATA_BIT_RATE_HZ, ge=1_000_000, le=8_000_000)
    """CAN FD: bit rate within the data, bit/s; ``slcan`` has 1000000, 2000000, 4000000, 5000000 and 8000000."""
    node: int = Field(1, ge=0, le=15)
    """Number of the device on the bus."""
    dbc: str | None = None
    """A definition with other identifiers; by default the shipped one for the bench's number of channels."""
    baud: int = Field(3_000_000, ge=9600)
    """``slcan``: baud rate of the serial line."""
    backend: Table = Field(default_factory=dict)
    """Further keyword arguments of python-can's backend, such as its bit timing; they override the keys above."""

    @property
    def timing(self) -> BusTiming:
        """Frames and bit rates of the bus."""
        return BusTiming(self.fd, self.bitrate, self.data_bitrate)


class CanDAQ(WireDAQ):
    """A device that speaks the wire protocol on a CAN bus.

    Options: `CanOptions`. The seed is ignored.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        options = validated(CanOptions, dict(bench.driver.options), "driver.options")
        super().__init__(bench, seed, options)
        self._can = options

    def _make_link(self) -> Link:
        can = self._can
        bus: FrameBus
        if can.interface == "slcan":
            bus = SlcanBus(str(can.channel), can.timing, can.baud)
        else:
            bus = PythonCanBus(can.interface, can.channel, can.timing, can.node, can.backend)
        return CanLink(bus, len(self.channels), can.timing, can.node, can.dbc)
