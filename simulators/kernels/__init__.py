"""What steps a virtual rig sample by sample, for compiled callers: kernels, and the arrays that they take."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from simulators.addressed import addressed as addressed, rig_at as rig_at, state_at as state_at
    from simulators.layout import Flag as Flag, RigArrays as RigArrays, RigState as RigState
    from simulators.plant.compilation import aligned as aligned, pad as pad
    from simulators.plant.kernels import advance as advance, joint_forces as joint_forces, local_forces as local_forces
    from simulators.products import combine as combine
    from simulators.sensing.noise.kernels import mix as mix, unit as unit
    from simulators.stepping import run_observed as run_observed, run_open_loop as run_open_loop, sample as sample
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
