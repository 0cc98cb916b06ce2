"""Checks of experiments before a model simulates them."""

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.experiments.simulators import Simulator


def belongs(model: Simulator, experiment: Experiment, what: str) -> None:
    """Raise `IdentificationError` unless the experiment has the channels and the sample rate of the model."""
    if abs(experiment.sample_rate_hz / model.sample_rate_hz - 1.0) > 1e-9:
        raise IdentificationError(
            f"sampled at {experiment.sample_rate_hz:g} Hz, the model is of {model.sample_rate_hz:g} Hz; resample one",
            where=what,
        )
    for name, mine, theirs in (
        ("inputs", model.inputs, experiment.input_channels),
        ("outputs", model.outputs, experiment.output_channels),
    ):
        if [c.name for c in mine] != [c.name for c in theirs]:
            have, need = (", ".join(c.name for c in channels) for channels in (theirs, mine))
            raise IdentificationError(f"{name} are {have}, the model has {need}", where=what)


def check_not_zero(experiment: Experiment, what: str) -> None:
    """Raise `IdentificationError` if an output is zero where it counts, because its relative error is undefined."""
    for channel, values in zip(experiment.output_channels, experiment.counted_outputs, strict=True):
        if not np.any(values):
            reason = f"output '{channel.name}' is zero where it counts, and errors relative to it have no meaning"
            raise IdentificationError(reason, where=what)
