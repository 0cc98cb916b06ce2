"""Models driven by a force or a voltage, PNLSS and structured ones: what predictions ask them, and their constant inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

import numpy as np

from identification import (
    Channel,
    Exciter,
    Experiment,
    PnlssModel,
    SteadyPrediction,
    SteadyStates,
    StructuredModel,
    frequency_response,
    steady_state,
)
from identification.experiments import Simulator
from identification.harmonic_balance import Held
from rig.errors import ConfigurationError
from vibrolock.arrays import Float

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


CONSTANT = "constant"
"""Name of the input of `identification.Experiment.with_constant_input`, whose value a model remembers."""


def constants_of(model: DrivenModel, given: Sequence[str], path: Path) -> dict[str, float]:
    """Return the values of constant inputs by name: those ``given`` as NAME=VALUE, and that of the offset's input.

    Raises `ConfigurationError` for values that cannot be, inputs that the model lacks, and a force or voltage.
    """
    found: dict[str, float] = {}
    names = [channel.name for channel in model.inputs]
    if CONSTANT in names and isinstance(model, PnlssModel):
        value = float(model.input_range[names.index(CONSTANT)])
        found |= {CONSTANT: value} if np.isfinite(value) else {}
    for text in given:
        name, _, value_text = text.partition("=")
        try:
            value = float(value_text)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise ConfigurationError(f"`constants` = {text!r}: allowed is NAME=VALUE, such as constant=1")
        if name not in names:
            raise ConfigurationError(
                f"`constants` = {text!r}: {path} has no input {name}; its inputs are {', '.join(names)}"
            )
        found[name] = value
    left = [channel for channel in model.inputs if channel.name not in found]
    if not left:
        raise ConfigurationError(f"`constants`: hold all inputs of {path}, and nothing drives it; leave one out")
    return found


def driving(channels: Sequence[Channel], constants: Mapping[str, float]) -> tuple[Channel, ...]:
    """Return the input channels that are not constant."""
    return tuple(channel for channel in channels if channel.name not in constants)


def all_inputs(model: Simulator, driven: Float, constants: Mapping[str, float]) -> Float:
    """Return all inputs of the model, float[n_inputs, n], from those that drive it and the constants."""
    rows = iter(driven)
    count = driven.shape[1]
    return np.array(
        [np.full(count, constants[c.name]) if c.name in constants else next(rows) for c in model.inputs], dtype=float
    )


def with_constants(experiment: Experiment, model: Simulator, constants: Mapping[str, float]) -> Experiment:
    """Return the experiment with the constant inputs of the model among its own."""
    if not constants:
        return experiment
    return replace(
        experiment, inputs=all_inputs(model, experiment.inputs, constants), input_channels=tuple(model.inputs)
    )
