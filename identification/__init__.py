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
    from identification.linear.modes import LinearModes
    from identification.linear.response_matrix import FrequencyResponseMatrix
    from identification.mapping import FrequencyResponseMapping, map_frequency_responses
    from identification.measurements import PeriodicVibration
    from identification.multisine.design import MultisineDesign
    from identification.multisine.spectra import InstrumentResponse, PeriodicSpectra, periodic_spectra
    from identification.nonlinear.mode_shapes import ModeShapes, mac
    from identification.nonlinear.nonlinear_modes import NonlinearMode
    from identification.nonlinear.phase_resonance import nonlinear_mode
    from identification.nonlinear.stepped_sine import stepped_sine_mode
    from identification.prediction.comparison import Comparison, PredictionError, compare, error_table
    from identification.prediction.exciter import Exciter, VoltagePath
    from identification.prediction.exciter_fit import identify_exciter
    from identification.prediction.frequency_response import frequency_response, steady_predictions
    from identification.prediction.properties import ExtrapolationError, ModalProperties
    from identification.prediction.recorded_force import recorded_force_response
    from identification.prediction.steady_prediction import SteadyPrediction
    from identification.prediction.sweep_inputs import VoltageSweep
    from identification.prediction.sweep_prediction import SweepPrediction, compare_sweep
    from identification.prediction.sweeps import predict_sweep
    from identification.prediction.uncertainty import ResponseBand, response_band
    from identification.signals.decimation import decimated
    from identification.signals.fourier import periodic_vibration
    from identification.signals.half_periods import HalfPeriods, zero_crossings
    from identification.signals.sweeps import ForceDropOut, force_drop_out
    from identification.signals.transients import Transient, demodulate

__all__ = [
    "Backbone",
    "Channel",
    "Comparison",
    "Exciter",
    "ExtrapolationError",
    "ForceDropOut",
    "FrequencyResponse",
    "FrequencyResponseMapping",
    "FrequencyResponseMatrix",
    "HalfPeriods",
    "IdentificationError",
    "InstrumentResponse",
    "LinearModes",
    "ModalProperties",
    "ModeShapes",
    "MultisineDesign",
    "NonlinearMode",
    "PeriodicSpectra",
    "PeriodicVibration",
    "PredictionError",
    "ResponseBand",
    "SteadyPrediction",
    "SweepPrediction",
    "Transient",
    "VoltagePath",
    "VoltageSweep",
    "compare",
    "compare_sweep",
    "decimated",
    "demodulate",
    "error_table",
    "force_drop_out",
    "frequency_response",
    "identify_exciter",
    "mac",
    "map_frequency_responses",
    "nonlinear_mode",
    "pack_frequency_responses",
    "periodic_spectra",
    "periodic_vibration",
    "predict_sweep",
    "recorded_force_response",
    "response_band",
    "steady_predictions",
    "stepped_sine_mode",
    "unpack_frequency_responses",
    "zero_crossings",
]

_MODULE_OF = {
    "Backbone": "backbones",
    "Channel": "channels",
    "Comparison": "prediction.comparison",
    "Exciter": "prediction.exciter",
    "ExtrapolationError": "prediction.properties",
    "ForceDropOut": "signals.sweeps",
    "FrequencyResponse": "frequency_responses",
    "FrequencyResponseMapping": "mapping",
    "FrequencyResponseMatrix": "linear.response_matrix",
    "HalfPeriods": "signals.half_periods",
    "IdentificationError": "errors",
    "InstrumentResponse": "multisine.spectra",
    "LinearModes": "linear.modes",
    "ModalProperties": "prediction.properties",
    "ModeShapes": "nonlinear.mode_shapes",
    "MultisineDesign": "multisine.design",
    "NonlinearMode": "nonlinear.nonlinear_modes",
    "PeriodicSpectra": "multisine.spectra",
    "PeriodicVibration": "measurements",
    "PredictionError": "prediction.comparison",
    "ResponseBand": "prediction.uncertainty",
    "SteadyPrediction": "prediction.steady_prediction",
    "SweepPrediction": "prediction.sweep_prediction",
    "Transient": "signals.transients",
    "VoltagePath": "prediction.exciter",
    "VoltageSweep": "prediction.sweep_inputs",
    "compare": "prediction.comparison",
    "compare_sweep": "prediction.sweep_prediction",
    "decimated": "signals.decimation",
    "demodulate": "signals.transients",
    "error_table": "prediction.comparison",
    "force_drop_out": "signals.sweeps",
    "frequency_response": "prediction.frequency_response",
    "identify_exciter": "prediction.exciter_fit",
    "mac": "nonlinear.mode_shapes",
    "map_frequency_responses": "mapping",
    "nonlinear_mode": "nonlinear.phase_resonance",
    "pack_frequency_responses": "frequency_responses",
    "periodic_spectra": "multisine.spectra",
    "periodic_vibration": "signals.fourier",
    "predict_sweep": "prediction.sweeps",
    "recorded_force_response": "prediction.recorded_force",
    "response_band": "prediction.uncertainty",
    "steady_predictions": "prediction.frequency_response",
    "stepped_sine_mode": "nonlinear.stepped_sine",
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
