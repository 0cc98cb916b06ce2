"""Models driven by a force or a voltage, PNLSS and structured ones: what predictions ask them."""

from collections.abc import Mapping
from typing import TypedDict

from identification import (
    Exciter,
    PnlssModel,
    SteadyPrediction,
    SteadyStates,
    StructuredModel,
    frequency_response,
    steady_state,
)
from identification.harmonic_balance import Held

DrivenModel = PnlssModel | StructuredModel

LARGEST_RANGE_USE = 3.0
"""Use of the trained range up to which a response is followed. Chosen: its part beyond the range carries a note."""


class Fixed(TypedDict, total=False):
    """What stays the same in all predictions of a model."""

    exciter: Exciter | None
    held_inputs: Mapping[str, float]


class _Level(TypedDict, total=False):
    force_n: float
    voltage_v: float
    force: Held


def _level(level: float, force: Held) -> _Level:
    return {"voltage_v": level} if force == "voltage" else {"force_n": level, "force": force}


def frequency_response_at(
    model: DrivenModel,
    level: float,
    *,
    force: Held,
    band_hz: tuple[float | None, float | None] | None = None,
    exciter: Exciter | None = None,
    held_inputs: Mapping[str, float] | None = None,
) -> SteadyPrediction:
    """Return the response at a constant level, of the force (N) or of the voltage (V)."""
    return frequency_response(
        model,
        exciter=exciter,
        held_inputs=held_inputs,
        band_hz=band_hz,
        largest_range_use=LARGEST_RANGE_USE,
        **_level(level, force),
    )


def steady_state_at(
    model: DrivenModel,
    level: float,
    frequency_hz: float,
    *,
    force: Held,
    near: SteadyStates | None = None,
    exciter: Exciter | None = None,
    held_inputs: Mapping[str, float] | None = None,
) -> SteadyStates:
    """Return the vibration at one level and frequency."""
    return steady_state(
        model,
        frequency_hz,
        exciter=exciter,
        held_inputs=held_inputs,
        near=near,
        largest_range_use=LARGEST_RANGE_USE,
        **_level(level, force),
    )
