"""The physics of shaker, stinger and structure: virtual rigs, sample by sample and by harmonic balance.

First::

    from simulators import VirtualRig
    from simulators.analysis import phase_resonance_backbone

    rig = VirtualRig.shipped("magnet-beam")
    backbone = phase_resonance_backbone(rig, voltages_v=[0.2, 0.4, 0.8])

Names, of which ``help(simulators.VirtualRig)`` and so on say more:

    VirtualRig              structure, local elements, exciter, stinger, sensors, converter
    Simulation              a virtual rig under a given output voltage
    shipped_specimens       names of the specimens that come with the program

`simulators.analysis` computes modes, frequency responses and backbones without a test; `simulators.ensemble` runs a function on
many variants of a rig.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from simulators.shipped import shipped_specimens as shipped_specimens
    from simulators.simulation import Simulation as Simulation
    from simulators.virtual_rig import VirtualRig as VirtualRig
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
