"""What callers share with the library: roles of channels, checks, options, parts of results, and the stored form of results."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.channels import (
        MOTION_ORDER as MOTION_ORDER,
        MOTION_UNIT as MOTION_UNIT,
        Motion as Motion,
        Role as Role,
        chosen_rows as chosen_rows,
        find_role as find_role,
    )
    from identification.decays.with_force import decay_with_force as decay_with_force
    from identification.frequency_responses import Controlled as Controlled
    from identification.linear.accelerance import Weighting as Weighting
    from identification.multisine.estimators import Estimator as Estimator
    from identification.nonlinear.nonlinear_modes import QUANTITIES as QUANTITIES, STANDARD_ERRORS as STANDARD_ERRORS
    from identification.response_control.levels import LevelFit as LevelFit
    from identification.storage import (
        Arrays as Arrays,
        Attributes as Attributes,
        decode as decode,
        encode as encode,
        stored as stored,
    )
    from identification.validation import one_specimen as one_specimen, positive as positive
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
