"""What errors and figures need of a model that is simulated."""

from typing import Any, Protocol, runtime_checkable

from identification.channels import Channel
from identification.experiments.experiment import Experiment
from vibrolock.arrays import Float


class SimulatedMotion(Protocol):
    """What a simulation returns: `identification.Simulation`, for example."""

    @property
    def outputs(self) -> Float:
        """float[n_outputs, n]."""

    @property
    def unbounded_at(self) -> int | None:
        """First sample at which the run is unbounded; None if there is none."""

    @property
    def range_use(self) -> float:
        """Largest of what the model knows the trained range of over that range; inf if unbounded, NaN if unknown."""


class CoupledSimulation(SimulatedMotion, Protocol):
    """What a simulation with an exciter returns."""

    @property
    def force_n(self) -> Float:
        """float[n], force at the model's input."""

    @property
    def passes(self) -> int:
        """Number of passes over the run."""

    @property
    def change(self) -> float:
        """RMS change of the force in the last pass over the RMS force; NaN for an unbounded run."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the run, one line each."""


class Driven(Protocol):
    """A model with inputs and outputs."""

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Input channels."""

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Output channels."""


class Simulator(Protocol):
    """A model that can be simulated."""

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Input channels."""

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Output channels."""

    @property
    def sample_rate_hz(self) -> float:
        """Sample rate of inputs and outputs."""

    def simulate(self, inputs: Any, /) -> SimulatedMotion:
        """Return the run from rest under ``inputs``, float[n_inputs, n]."""


@runtime_checkable
class Follower(Protocol):
    """A model that begins the run of an experiment in its own way."""

    def simulate_experiment(self, experiment: Experiment) -> SimulatedMotion:
        """Return the run under the inputs of an experiment."""


def simulated(model: Simulator, experiment: Experiment) -> SimulatedMotion:
    """Return the run under the inputs of an experiment: begun in the model's own way, or from rest."""
    return model.simulate_experiment(experiment) if isinstance(model, Follower) else model.simulate(experiment.inputs)
