"""The control law of a phase-locked vibration test: numbers in, numbers out, no files and no clock.

First::

    from controller import preset

    loop = preset("magnet-beam")
    print(loop.detector, loop.k1, loop.k2)

Names, of which ``help(controller.Law)`` and so on say more:

    PhaseLockedLoop, OpenLoop   the tables `[controller]` of plans
    LockRule, preset            when a lock counts as gained or lost; gains of the paper
    Law, control_state          all parameters of the law in one record, and its state in another
    Detector, FrequencyLaw, AmplitudeLaw, ForceLoop, LockState    its parts

`controller.kernels` has the kernels that step the law (``detect``, ``follow`` and so on), `controller.tuning` computes gains.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from controller.amplitude import AmplitudeLaw as AmplitudeLaw
    from controller.detector import Detector as Detector
    from controller.force import ForceLoop as ForceLoop
    from controller.frequency import FrequencyLaw as FrequencyLaw
    from controller.law import Law as Law, OpenLoop as OpenLoop, control_state as control_state
    from controller.lock import LockRule as LockRule, LockState as LockState
    from controller.pll import PhaseLockedLoop as PhaseLockedLoop
    from controller.presets import preset as preset
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
