"""What errors and figures need of a model that is simulated."""

from typing import Any, Protocol, runtime_checkable

from identification.channels import Channel
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation


class Driven(Protocol):
    """A model with inputs and outputs."""

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Input channels."""

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Output channels."""


class Simulator(Driven, Protocol):
    """A model that can be simulated."""

    @property
    def sample_rate_hz(self) -> float:
        """Sample rate of inputs and outputs."""

    def simulate(self, inputs: Any, /) -> Simulation:
        """Return the run from rest under ``inputs``, float[n_inputs, n]."""


@runtime_checkable
class Follower(Protocol):
    """A model that begins the run of an experiment in its own way."""

    def simulate_experiment(self, experiment: Experiment) -> Simulation:
        """Return the run under the inputs of an experiment."""


@runtime_checkable
class Stepped(Protocol):
    """A model that is integrated in steps, whose error falls with their square."""

    def with_half_steps(self) -> Simulator:
        """Return the model with steps of half the length."""


def simulated(model: Simulator, experiment: Experiment) -> Simulation:
    """Return the run under the inputs of an experiment: begun in the model's own way, or from rest."""
    return model.simulate_experiment(experiment) if isinstance(model, Follower) else model.simulate(experiment.inputs)
