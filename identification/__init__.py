"""Measurements in memory, models of nonlinear modes, and their scores.

The names below are imported on first use, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.backbones import Backbone
    from identification.channels import Channel
    from identification.decimation import decimated
    from identification.errors import IdentificationError
    from identification.fourier import periodic_vibration
    from identification.frequency_responses import (
        FrequencyResponse,
        pack_frequency_responses,
        unpack_frequency_responses,
    )
    from identification.half_periods import HalfPeriods, zero_crossings
    from identification.mapping import FrequencyResponseMapping, map_frequency_responses
    from identification.measurements import PeriodicVibration
    from identification.mode_shapes import ModeShapes, mac
    from identification.multisine import MultisineDesign
    from identification.multisine_spectra import InstrumentResponse, PeriodicSpectra, periodic_spectra
    from identification.nonlinear_modes import NonlinearMode
    from identification.phase_resonance import nonlinear_mode
    from identification.stepped_sine import stepped_sine_mode
    from identification.sweeps import ForceDropOut, force_drop_out
    from identification.transients import Transient, demodulate

__all__ = [
    "Backbone",
    "Channel",
    "ForceDropOut",
    "FrequencyResponse",
    "FrequencyResponseMapping",
    "HalfPeriods",
    "IdentificationError",
    "InstrumentResponse",
    "ModeShapes",
    "MultisineDesign",
    "NonlinearMode",
    "PeriodicSpectra",
    "PeriodicVibration",
    "Transient",
    "decimated",
    "demodulate",
    "force_drop_out",
    "mac",
    "map_frequency_responses",
    "nonlinear_mode",
    "pack_frequency_responses",
    "periodic_spectra",
    "periodic_vibration",
    "stepped_sine_mode",
    "unpack_frequency_responses",
    "zero_crossings",
]

_MODULE_OF = {
    "Backbone": "backbones",
    "Channel": "channels",
    "ForceDropOut": "sweeps",
    "FrequencyResponse": "frequency_responses",
    "FrequencyResponseMapping": "mapping",
    "HalfPeriods": "half_periods",
    "IdentificationError": "errors",
    "InstrumentResponse": "multisine_spectra",
    "ModeShapes": "mode_shapes",
    "MultisineDesign": "multisine",
    "NonlinearMode": "nonlinear_modes",
    "PeriodicSpectra": "multisine_spectra",
    "PeriodicVibration": "measurements",
    "Transient": "transients",
    "decimated": "decimation",
    "demodulate": "transients",
    "force_drop_out": "sweeps",
    "mac": "mode_shapes",
    "map_frequency_responses": "mapping",
    "nonlinear_mode": "phase_resonance",
    "pack_frequency_responses": "frequency_responses",
    "periodic_spectra": "multisine_spectra",
    "periodic_vibration": "fourier",
    "stepped_sine_mode": "stepped_sine",
    "unpack_frequency_responses": "frequency_responses",
    "zero_crossings": "half_periods",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
