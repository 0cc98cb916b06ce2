"""Inputs of a model that are constant in a prediction: offsets, and whatever else a recording does not hold."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification import Channel, Experiment, PnlssModel
from identification.experiments import Simulator
from rig.errors import ConfigurationError
from rig.results.simulated.driven_models import DrivenModel
from vibrolock.arrays import Float

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
