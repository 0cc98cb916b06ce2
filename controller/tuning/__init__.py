"""Gain design as pure functions: model of the plant near a mode, control laws, and assessment of the closed loop.

`PlantModel.from_frequency_responses` fits the plant. `hippold_gains`, `exact_phase_law`, `exact_scheduled_law`,
`frequency_error_law` and `complex_response_law` compute gains. `assess` evaluates given laws; `design_phase_law` chooses the
gains of a phase law.
"""

from controller.tuning.design import Design, Settling, Steps, assess, design_phase_law, worst
from controller.tuning.exact import complex_response_law, exact_phase_law, exact_scheduled_law, frequency_error_law
from controller.tuning.hippold import HippoldGains, hippold_gains
from controller.tuning.laws import (
    ComplexResponseLaw,
    ForceLaw,
    FrequencyErrorLaw,
    LogForceLaw,
    LogResponseLaw,
    PhaseLaw,
)
from controller.tuning.loop import ControlLoop, control_loop, lag_per_frequency
from controller.tuning.noise import LowPassChoice, low_pass_from_densities, low_pass_from_noise
from controller.tuning.plant import PlantModel
from controller.tuning.stability import (
    LARGEST_AT_HALF,
    Margins,
    changes_of_hardening,
    closed_loop_poles,
    gains_at_half,
    hardening_margins,
    margins,
    unstable_poles,
)
from controller.tuning.steps import settling_s, step_response

__all__ = [
    "LARGEST_AT_HALF",
    "ComplexResponseLaw",
    "ControlLoop",
    "Design",
    "ForceLaw",
    "FrequencyErrorLaw",
    "HippoldGains",
    "LogForceLaw",
    "LogResponseLaw",
    "LowPassChoice",
    "Margins",
    "PhaseLaw",
    "PlantModel",
    "Settling",
    "Steps",
    "assess",
    "changes_of_hardening",
    "closed_loop_poles",
    "complex_response_law",
    "control_loop",
    "design_phase_law",
    "exact_phase_law",
    "exact_scheduled_law",
    "frequency_error_law",
    "gains_at_half",
    "hardening_margins",
    "hippold_gains",
    "lag_per_frequency",
    "low_pass_from_densities",
    "low_pass_from_noise",
    "margins",
    "settling_s",
    "step_response",
    "unstable_poles",
    "worst",
]
