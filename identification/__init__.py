"""Measurements in memory, models of nonlinear modes, and their scores.

The names below are imported on first use, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.backbones import Backbone
    from identification.channels import Channel
    from identification.errors import IdentificationError
    from identification.frequency_responses import (
        FrequencyResponse,
        pack_frequency_responses,
        unpack_frequency_responses,
    )
    from identification.linear.extrapolation import extrapolated_to_zero
    from identification.linear.modal_analysis import linear_modes
    from identification.linear.mode_correlation import mac_matrix
    from identification.linear.modes import LinearModes
    from identification.linear.response_matrix import FrequencyResponseMatrix
    from identification.linear.stabilisation import StabilisationDiagram, stabilisation
    from identification.linear.subspace import StateSpace, subspace
    from identification.mapping import FrequencyResponseMapping, map_frequency_responses
    from identification.measurements import PeriodicVibration
    from identification.multisine.design import MultisineDesign
    from identification.multisine.spectra import InstrumentResponse, PeriodicSpectra, periodic_spectra
    from identification.nonlinear.mode_shapes import ModeShapes, mac
    from identification.nonlinear.nonlinear_modes import NonlinearMode
    from identification.nonlinear.phase_resonance import nonlinear_mode
    from identification.nonlinear.stepped_sine import stepped_sine_mode
    from identification.signals.decimation import decimated
    from identification.signals.fourier import periodic_vibration
    from identification.signals.half_periods import HalfPeriods, zero_crossings
    from identification.signals.sweeps import ForceDropOut, force_drop_out
    from identification.signals.transients import Transient, demodulate

__all__ = [
    "Backbone",
    "Channel",
    "ForceDropOut",
    "FrequencyResponse",
    "FrequencyResponseMapping",
    "FrequencyResponseMatrix",
    "HalfPeriods",
    "IdentificationError",
    "InstrumentResponse",
    "LinearModes",
    "ModeShapes",
    "MultisineDesign",
    "NonlinearMode",
    "PeriodicSpectra",
    "PeriodicVibration",
    "StabilisationDiagram",
    "StateSpace",
    "Transient",
    "decimated",
    "demodulate",
    "extrapolated_to_zero",
    "force_drop_out",
    "linear_modes",
    "mac",
    "mac_matrix",
    "map_frequency_responses",
    "nonlinear_mode",
    "pack_frequency_responses",
    "periodic_spectra",
    "periodic_vibration",
    "stabilisation",
    "stepped_sine_mode",
    "subspace",
    "unpack_frequency_responses",
    "zero_crossings",
]

_MODULE_OF = {
    "Backbone": "backbones",
    "Channel": "channels",
    "ForceDropOut": "signals.sweeps",
    "FrequencyResponse": "frequency_responses",
    "FrequencyResponseMapping": "mapping",
    "FrequencyResponseMatrix": "linear.response_matrix",
    "HalfPeriods": "signals.half_periods",
    "IdentificationError": "errors",
    "InstrumentResponse": "multisine.spectra",
    "LinearModes": "linear.modes",
    "ModeShapes": "nonlinear.mode_shapes",
    "MultisineDesign": "multisine.design",
    "NonlinearMode": "nonlinear.nonlinear_modes",
    "PeriodicSpectra": "multisine.spectra",
    "PeriodicVibration": "measurements",
    "StabilisationDiagram": "linear.stabilisation",
    "StateSpace": "linear.subspace",
    "Transient": "signals.transients",
    "decimated": "signals.decimation",
    "demodulate": "signals.transients",
    "extrapolated_to_zero": "linear.extrapolation",
    "force_drop_out": "signals.sweeps",
    "linear_modes": "linear.modal_analysis",
    "mac": "nonlinear.mode_shapes",
    "mac_matrix": "linear.mode_correlation",
    "map_frequency_responses": "mapping",
    "nonlinear_mode": "nonlinear.phase_resonance",
    "pack_frequency_responses": "frequency_responses",
    "periodic_spectra": "multisine.spectra",
    "periodic_vibration": "signals.fourier",
    "stabilisation": "linear.stabilisation",
    "stepped_sine_mode": "nonlinear.stepped_sine",
    "subspace": "linear.subspace",
    "unpack_frequency_responses": "frequency_responses",
    "zero_crossings": "signals.half_periods",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
