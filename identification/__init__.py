"""Measurements in memory, models of nonlinear modes, and their scores.

The names below are imported on first use, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.backbones import Backbone
    from identification.channels import Channel
    from identification.errors import IdentificationError
    from identification.fourier import periodic_vibration
    from identification.frequency_responses import (
        FrequencyResponse,
        pack_frequency_responses,
        unpack_frequency_responses,
    )
    from identification.mapping import FrequencyResponseMapping, map_frequency_responses
    from identification.measurements import PeriodicVibration
    from identification.mode_shapes import ModeShapes, mac
    from identification.nonlinear_modes import NonlinearMode
    from identification.phase_resonance import nonlinear_mode
    from identification.stepped_sine import stepped_sine_mode

__all__ = [
    "Backbone",
    "Channel",
    "FrequencyResponse",
    "FrequencyResponseMapping",
    "IdentificationError",
    "ModeShapes",
    "NonlinearMode",
    "PeriodicVibration",
    "mac",
    "map_frequency_responses",
    "nonlinear_mode",
    "pack_frequency_responses",
    "periodic_vibration",
    "stepped_sine_mode",
    "unpack_frequency_responses",
]

_MODULE_OF = {
    "Backbone": "backbones",
    "Channel": "channels",
    "FrequencyResponse": "frequency_responses",
    "FrequencyResponseMapping": "mapping",
    "IdentificationError": "errors",
    "ModeShapes": "mode_shapes",
    "NonlinearMode": "nonlinear_modes",
    "PeriodicVibration": "measurements",
    "mac": "mode_shapes",
    "map_frequency_responses": "mapping",
    "nonlinear_mode": "phase_resonance",
    "pack_frequency_responses": "frequency_responses",
    "periodic_vibration": "fourier",
    "stepped_sine_mode": "stepped_sine",
    "unpack_frequency_responses": "frequency_responses",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
