"""Dynamic models: modal, polynomial state-space (PNLSS) and structured ones."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.models.dynamic_model import LARGEST_RANGE_USE as LARGEST_RANGE_USE
    from identification.models.modal.frequency_response import HeldForce as HeldForce
    from identification.models.modal.sweep_prediction import as_recorded as as_recorded
    from identification.models.pnlss.error_table import SAME_LEVEL as SAME_LEVEL, ModelTest as ModelTest
    from identification.models.pnlss.features import FUNCTIONS as FUNCTIONS
    from identification.models.pnlss.user_functions import is_users as is_users
    from identification.models.simulated_runs import run_of as run_of
    from identification.models.structured.extrapolation import check_response as check_response
    from identification.models.structured.fit import drawn as drawn, std_of as std_of
    from identification.models.structured.identified import FittedNumber as FittedNumber
    from identification.models.structured.laws import (
        LAWS as LAWS,
        BoucWen as BoucWen,
        Coulomb as Coulomb,
        Damper as Damper,
        Iwan as Iwan,
        Jenkins as Jenkins,
        Joint as Joint,
        Law as Law,
        MagnetSpring as MagnetSpring,
        Masing as Masing,
        PolynomialDamper as PolynomialDamper,
        PolynomialSpring as PolynomialSpring,
        SplineSpring as SplineSpring,
        Spring as Spring,
        Stop as Stop,
        Stribeck as Stribeck,
        UserSpring as UserSpring,
    )
    from identification.models.structured.open_quantities import (
        check_input as check_input,
        peak_band as peak_band,
        run_band as run_band,
    )
    from identification.models.structured.regression import law_force as law_force
    from identification.models.structured.start import linear_start as linear_start
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
