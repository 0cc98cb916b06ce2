"""The device's half of the wire protocol, with a virtual rig behind it."""

from rig.emulator.device import Device
from rig.emulator.faults import Faults
from rig.emulator.plant import VirtualPlant, Wiring

__all__ = ["Device", "Faults", "VirtualPlant", "Wiring"]
