"""The device's half of the wire protocol, with a virtual rig behind it."""

from rig.wire.device.device import Device
from rig.wire.device.faults import Faults
from rig.wire.device.plant import Plant, VirtualPlant, Wiring

__all__ = ["Device", "Faults", "Plant", "VirtualPlant", "Wiring"]
