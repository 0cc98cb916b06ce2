"""Former names of public functions, which warn and call what replaces them."""

import warnings
from collections.abc import Callable
from typing import Any

from identification.harmonic_balance.states import HarmonicResponse, SteadyStates
from identification.models import responses
from identification.prediction.steady_prediction import SteadyPrediction

_LARGEST_RANGE_USE = 3.0
"""Default of the former functions for PNLSS and structured models."""
_BACKBONE_POINTS = 300
"""Default of the former `structured_backbone`."""


def _options(force_n: float, force: str, how: dict[str, Any]) -> dict[str, Any]:
    band = how.pop("lowest_hz", None), how.pop("highest_hz", None)
    held = {"voltage_v": force_n} if force == "voltage" else {"force_n": force_n, "force": force}
    return {
        **({} if band == (None, None) else {"band_hz": band}),
        "largest_range_use": _LARGEST_RANGE_USE,
        **held,
        **how,
    }


def _warn(old: str, new: str) -> None:
    warnings.warn(f"identification.{old} is now identification.{new}", DeprecationWarning, stacklevel=3)


def _response(old: str, new: str, default_force: str, call: Callable[..., Any]) -> Callable[..., Any]:
    def former(model: object, force_n: float, *, force: str = default_force, **how: Any) -> Any:
        _warn(old, new)
        return call(model, **_options(force_n, force, how))

    return _named(former, old, new)


def _steady_state(old: str, default_force: str) -> Callable[..., SteadyStates]:
    def former(
        model: object, force_n: float, frequency_hz: float, *, force: str = default_force, **how: Any
    ) -> SteadyStates:
        _warn(old, "steady_state")
        return responses.steady_state(model, frequency_hz, **_options(force_n, force, how))

    return _named(former, old, "steady_state")


def _coupled_run(old: str) -> Callable[..., Any]:
    def former(*args: Any, **how: Any) -> Any:
        _warn(old, "coupled_run")
        return responses.coupled_run(*args, **how)

    return _named(former, old, "coupled_run")


def _named(former: Callable[..., Any], old: str, new: str) -> Callable[..., Any]:
    former.__name__, former.__doc__ = old, f"Former name of `{new}`: warns, and passes its options on."
    return former


pnlss_frequency_response: Callable[..., SteadyPrediction] = _response(
    "pnlss_frequency_response", "frequency_response", "fundamental", responses.frequency_response
)
structured_frequency_response: Callable[..., SteadyPrediction] = _response(
    "structured_frequency_response", "frequency_response", "pure-sine", responses.frequency_response
)
pnlss_response: Callable[..., HarmonicResponse] = _response(
    "pnlss_response", "harmonic_response", "fundamental", responses.harmonic_response
)
structured_response: Callable[..., HarmonicResponse] = _response(
    "structured_response", "harmonic_response", "pure-sine", responses.harmonic_response
)
pnlss_steady_state = _steady_state("pnlss_steady_state", "fundamental")
structured_steady_state = _steady_state("structured_steady_state", "pure-sine")
pnlss_coupled_run, structured_coupled_run = _coupled_run("pnlss_coupled_run"), _coupled_run("structured_coupled_run")


def structured_backbone(model: object, force_n: float, **how: Any) -> SteadyStates:
    """Former name of `backbone`: warns, and passes its options on."""
    _warn("structured_backbone", "backbone")
    return responses.backbone(
        model,
        force_n,
        **{"largest_range_use": _LARGEST_RANGE_USE, "points": _BACKBONE_POINTS, "force": "pure-sine", **how},
    )
