"""The virtual driver: a shaker, a stinger and a structure in software behind the DAQ contract."""

from rig.drivers.virtual.driver import VirtualDAQ

__all__ = ["VirtualDAQ"]
