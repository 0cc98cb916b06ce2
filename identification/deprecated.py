"""Former names of public functions, which warn and call what replaces them."""

import warnings
from collections.abc import Callable
from typing import Any, TypeVar

from identification.models import responses

T = TypeVar("T")


def _former(call: Callable[..., T], old: str, force: str, **defaults: Any) -> Callable[..., T]:
    """Return the function of a former name: its third argument, if any, was the frequency, and its force may be a voltage."""

    def former(model: object, force_n: float, *frequency_hz: float, force: str = force, **how: Any) -> T:
        _warn(old, call)
        band = how.pop("lowest_hz", None), how.pop("highest_hz", None)
        held = {"voltage_v": force_n} if force == "voltage" else {"force_n": force_n, "force": force}
        bands = {} if band == (None, None) else {"band_hz": band}
        return call(model, *frequency_hz, **{"largest_range_use": 3.0, **defaults, **bands, **held, **how})

    return _named(former, old, call)


def _former_run(old: str) -> Callable[..., Any]:
    def former(*args: Any, **how: Any) -> Any:
        _warn(old, responses.coupled_run)
        return responses.coupled_run(*args, **how)

    return _named(former, old, responses.coupled_run)


def _warn(old: str, call: Callable[..., Any]) -> None:
    message = f"identification.{old} is now identification.{call.__name__}"
    warnings.warn(message, DeprecationWarning, stacklevel=3)


def _named(former: Callable[..., T], old: str, call: Callable[..., Any]) -> Callable[..., T]:
    former.__name__, former.__doc__ = old, f"Former name of `{call.__name__}`: warns, and passes its options on."
    return former


pnlss_frequency_response = _former(responses.frequency_response, "pnlss_frequency_response", "fundamental")
structured_frequency_response = _former(responses.frequency_response, "structured_frequency_response", "pure-sine")
pnlss_response = _former(responses.harmonic_response, "pnlss_response", "fundamental")
structured_response = _former(responses.harmonic_response, "structured_response", "pure-sine")
pnlss_steady_state = _former(responses.steady_state, "pnlss_steady_state", "fundamental")
structured_steady_state = _former(responses.steady_state, "structured_steady_state", "pure-sine")
structured_backbone = _former(responses.backbone, "structured_backbone", "pure-sine", points=300)
pnlss_coupled_run, structured_coupled_run = _former_run("pnlss_coupled_run"), _former_run("structured_coupled_run")
