"""The physics of shaker, stinger and structure: a virtual rig sample by sample. The names below are imported on first use."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from simulators.shipped import shipped_specimens
    from simulators.simulation import Simulation
    from simulators.virtual_rig import VirtualRig
else:
    __getattr__, __dir__ = on_use(
        __name__,
        {
            "Simulation": "simulation",
            "VirtualRig": "virtual_rig",
            "shipped_specimens": "shipped",
        },
    )

__all__ = ["Simulation", "VirtualRig", "shipped_specimens"]
