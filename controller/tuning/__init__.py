"""Gain design as pure functions: model of the plant near a mode, control laws, and assessment of the closed loop.

`PlantModel.from_frequency_responses` fits the plant. `hippold_gains`, `exact_phase_law` and `complex_response_law` compute
gains. `assess` evaluates given laws; `design_phase_law` chooses the gains of a phase law.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from controller.tuning.design import (
        Design as Design,
        Settling as Settling,
        Steps as Steps,
        assess as assess,
        design_phase_law as design_phase_law,
        worst as worst,
    )
    from controller.tuning.exact import (
        complex_response_law as complex_response_law,
        exact_phase_law as exact_phase_law,
        frequencies_for as frequencies_for,
    )
    from controller.tuning.hippold import HippoldGains as HippoldGains, hippold_gains as hippold_gains
    from controller.tuning.laws import (
        ComplexResponseLaw as ComplexResponseLaw,
        ForceLaw as ForceLaw,
        FrequencyErrorLaw as FrequencyErrorLaw,
        LogForceLaw as LogForceLaw,
        LogResponseLaw as LogResponseLaw,
        PhaseLaw as PhaseLaw,
    )
    from controller.tuning.loop import (
        ControlLoop as ControlLoop,
        control_loop as control_loop,
    )
    from controller.tuning.noise import (
        LowPassChoice as LowPassChoice,
        low_pass_from_densities as low_pass_from_densities,
    )
    from controller.tuning.plant import PlantModel as PlantModel
    from controller.tuning.stability import (
        LARGEST_AT_HALF as LARGEST_AT_HALF,
        Margins as Margins,
        changes_of_hardening as changes_of_hardening,
        closed_loop_poles as closed_loop_poles,
        gains_at_half as gains_at_half,
        hardening_margins as hardening_margins,
        margins as margins,
        unstable_poles as unstable_poles,
    )
    from controller.tuning.steps import settling_s as settling_s, step_response as step_response
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
