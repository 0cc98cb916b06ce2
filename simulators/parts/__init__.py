"""The parts of a virtual rig as its description has them, and the descriptions that come with the program."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from simulators.exciter import Exciter as Exciter, Stinger as Stinger
    from simulators.scatter import Deviation as Deviation, Scatter as Scatter
    from simulators.sensing.parts import (
        LOWEST_INTERNAL_RATE_HZ as LOWEST_INTERNAL_RATE_HZ,
        Converter as Converter,
        Sensor as Sensor,
    )
    from simulators.shipped import shaker_descriptions as shaker_descriptions, specimen_table as specimen_table
    from simulators.sites.elements import (
        Clearance as Clearance,
        Cubic as Cubic,
        DampingTable as DampingTable,
        ForceTable as ForceTable,
        Magnet as Magnet,
        User as User,
    )
    from simulators.sites.friction import FrictionSite as FrictionSite, IwanSite as IwanSite, JenkinsSite as JenkinsSite
    from simulators.structures.meshed import LumpedMass as LumpedMass, MeshedBeam as MeshedBeam, Support as Support
    from simulators.structures.structure import (
        BeamStructure as BeamStructure,
        LapJointedBeam as LapJointedBeam,
        ModalStructure as ModalStructure,
    )
    from simulators.wear import Wear as Wear
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
