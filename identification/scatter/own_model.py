"""A model that takes on the shifts of the run that it is compared with."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.channels import Channel
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.models.simulated_runs import run_of
from identification.scatter.own_shifts import own_shift
from identification.scatter.run_scatter import RunScatter
from identification.scatter.shifts import Scattered, shifted


@dataclass(frozen=True, eq=False)
class OwnModel:
    """A model with scatter whose shifts are estimated for each experiment, from its outputs and the distribution.

    So an error says what the shared parameters get wrong, as that of an experiment with an estimated initial state does. Inputs
    alone are simulated in the middle of the distribution.
    """

    model: Scattered
    scatter: RunScatter

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Input channels."""
        return self.model.inputs

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Output channels."""
        return self.model.outputs

    @property
    def sample_rate_hz(self) -> float:
        """Sample rate of inputs and outputs."""
        return self.model.sample_rate_hz

    def simulate(self, inputs: Any, /) -> Simulation:
        """Return the run from rest under ``inputs``, float[n_inputs, n]."""
        return self.model.simulate(inputs)

    def simulate_experiment(self, experiment: Experiment) -> Simulation:
        """Return the run under the inputs of an experiment, with its own shifts."""
        return run_of(self.of([experiment]), experiment)

    def of(self, experiments: Sequence[Experiment]) -> Scattered:
        """Return the model of the run to which all ``experiments`` belong."""
        scale = np.sqrt(np.mean(np.concatenate([one.counted_outputs for one in experiments], axis=1) ** 2, axis=1))
        effects, width = self.scatter.effects, np.array([one.width for one in self.scatter.widths])
        found = own_shift(self.model, effects, experiments, scale, np.zeros(len(effects)))
        return shifted(self.model, effects, found.shift * width**2 / np.maximum(width**2 + found.variance, 1e-300))
