"""Drivers over a wire: the host's half of the protocol, whatever carries it."""

from rig.drivers.wire.driver import WireDAQ
from rig.drivers.wire.options import LoopOptions, WireOptions

__all__ = ["LoopOptions", "WireDAQ", "WireOptions"]
