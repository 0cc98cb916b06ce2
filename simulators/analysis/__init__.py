"""Analysis without a test: frequency responses, and periodic vibrations of the coupled rig by harmonic balance."""

from simulators.analysis.errors import NotConvergedError
from simulators.analysis.frequency_responses import FrequencyResponses, frequency_response
from simulators.analysis.harmonic_balance import (
    constant_displacement_response,
    constant_force_response,
    forced_response,
    phase_resonance_backbone,
)
from simulators.analysis.hysteresis import hysteresis_loops
from simulators.analysis.responses import HysteresisLoop, PeriodicResponses

__all__ = [
    "FrequencyResponses",
    "HysteresisLoop",
    "NotConvergedError",
    "PeriodicResponses",
    "constant_displacement_response",
    "constant_force_response",
    "forced_response",
    "frequency_response",
    "hysteresis_loops",
    "phase_resonance_backbone",
]
