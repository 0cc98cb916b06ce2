"""Computed analysis of a virtual rig: frequency responses, and periodic vibrations by harmonic balance."""

from simulators.analysis.frequency_responses import FrequencyResponses, frequency_response
from simulators.analysis.harmonic_balance import (
    constant_displacement_response,
    constant_force_response,
    forced_response,
    phase_resonance_backbone,
)
from simulators.analysis.responses import HysteresisLoop, NotConvergedError, PeriodicResponses
from simulators.analysis.site_forces import hysteresis_loops

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
