"""Models driven by a force or a voltage, PNLSS and structured ones: what predictions ask them, and their constant inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

import numpy as np

from identification import Channel, Exciter, Experiment, PnlssModel, Simulation, StructuredModel, coupled_run
from identification.experiments import Simulator
from identification.harmonic_balance import Held
from rig.errors import ConfigurationError
from rig.measurements.experiments.build import FEWEST_SAMPLES_PER_PERIOD
from vibrolock.arrays import Float

DrivenModel = PnlssModel | StructuredModel

LARGEST_RANGE_USE = 3.0
"""Use of the trained range up to which a response is followed. Chosen: its part beyond the range carries a note."""


class Fixed(TypedDict, total=False):
    """What stays the same in all predictions of a model."""

    exciter: Exciter | None
    held_inputs: Mapping[str, float]
    largest_range_use: float
    stability: bool


class Level(TypedDict, total=False):
    """A held level as `identification.frequency_response` takes it."""

    force_n: float
    voltage_v: float
    force: Held


def level_of(level: float, held: Held) -> Level:
    """Return the level of what is held: of the force (N) or of the voltage (V)."""
    return {"voltage_v": level} if held == "voltage" else {"force_n": level, "force": held}


def coupled(model: DrivenModel, exciter: Exciter, voltage_v: Float, lowest_hz: float) -> Simulation:
    """Simulate a model behind its exciter, whose reaction is exact over the band of the voltage and of the model."""
    if isinstance(model, PnlssModel) and model.excited_hz:
        lowest_hz = min(lowest_hz, model.excited_hz[0])
    return coupled_run(model, exciter, voltage_v, lowest_hz=_LOWEST * lowest_hz)


def check_rate(source: str, highest_hz: float, rate_hz: float) -> None:
    """Raise `ConfigurationError` for a plan that goes too high for the sample rate of a model."""
    if FEWEST_SAMPLES_PER_PERIOD * highest_hz >= rate_hz:
        raise ConfigurationError(
            f"{source}: goes up to {highest_hz:g} Hz; a model at {rate_hz:g} Hz allows below "
            f"{rate_hz / FEWEST_SAMPLES_PER_PERIOD:g} Hz"
        )


_LOWEST = 0.8
"""Part of the lowest frequency above which the exciter's reaction is exact."""
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
