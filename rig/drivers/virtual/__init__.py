"""The virtual driver: a shaker, a stinger and a structure in software behind the DAQ contract."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from rig.drivers.virtual.driver import VirtualDAQ as VirtualDAQ
else:
    __getattr__, __dir__, __all__ = on_use(__name__)  # `rig list` reads the parts alone
