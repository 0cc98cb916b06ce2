"""Errors of a PNLSS model simulated with the inputs of experiments, and estimated initial states."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.checks import belongs
from identification.experiments.errors import PnlssErrors, errors_of
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.experiments.simulators import Simulator, simulated
from identification.models.pnlss.fitting.blocks import SAMPLES, fitted_initial_state
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import records_of
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_ENOUGH = 1e3
"""The search for the sizes of states ends once the response of the outputs exceeds this multiple of the largest so far."""


def pnlss_errors(
    model: PnlssModel | Simulator, experiments: Sequence[Experiment], *, samples: int = SAMPLES
) -> PnlssErrors:
    """Simulate each experiment and compare.

    A model of another kind begins from rest, or as it does itself (`identification.experiments.simulators.Follower`).

    Raises `IdentificationError` if there are no experiments, their channels or sample rates differ from the model's, or an
    output is zero where it counts.

    Parameters
    ----------
    model
        The model.
    experiments
        The experiments.
    samples
        Number of samples to which an initial state is fitted, where an experiment wants one to be estimated.
    """

    def simulate(experiment: Experiment) -> Simulation:
        if isinstance(model, PnlssModel) and experiment.initial_state == "estimated":
            begin = estimated_initial_state(model, experiment, samples=samples)
            return model.simulate(experiment.inputs, initial_state=begin)
        return simulated(model, experiment)

    return errors_of(model, experiments, simulate)


def estimated_initial_state(model: PnlssModel, experiment: Experiment, *, samples: int = SAMPLES) -> Float:
    """Return the state before the first sample, float[n_states], by least squares, each output over its RMS.

    Unobservable combinations of states stay near zero. For this the states are scaled so that each alone has an equal effect
    on the outputs; the result then depends neither on the units of the states nor on a known range.

    Raises `IdentificationError` on other channels, another sample rate, too few samples.

    Parameters
    ----------
    model
        The model.
    experiment
        The experiment; its channels and sample rate are those of the model.
    samples
        Number of samples from the first that counts on, to which the outputs are fitted.
    """
    belongs(model, experiment, f"experiment{f' ({experiment.name})' if experiment.name else ''}")
    if not samples * len(model.outputs) >= model.states:
        raise IdentificationError(f"too few for {model.states} states", field="samples", value=samples)
    part = replace(experiment, period_samples=0)
    inputs, outputs = (
        np.where(rms > 0.0, rms, 1.0)
        for rms in (np.sqrt(np.mean(values**2, axis=1)) for values in (part.inputs, part.counted_outputs))
    )
    states = _seen_alike(model, outputs, samples)
    scaled = model.scaled(states=states, inputs=inputs, outputs=outputs)
    parameters = Parameters(scaled)
    system = parameters.system(parameters.vector(scaled, np.zeros((0, model.states))))
    (record,) = records_of([part], inputs, outputs)
    return states * fitted_initial_state(system, record, np.ones(len(outputs)), samples)


def _seen_alike(model: PnlssModel, outputs: Float, samples: int) -> Float:
    """float[n_states]: initial size of each state alone, near rest, at which an output reaches its RMS within ``samples``.

    For an unobservable state: its trained range or, if that is unknown, the smallest size of the other states.
    """
    rest = np.zeros((model.states + len(model.inputs), 1))
    by_state, by_output = (
        coefficients @ features.derivatives(rest)[:, : model.states, 0]
        for coefficients, features in ((model.e, model.state_features), (model.f, model.output_features))
    )
    row, seen = (model.c + by_output) / outputs[:, None], np.zeros(model.states)
    for _ in range(samples):
        seen = np.fmax(seen, np.max(np.abs(row), axis=0))
        row = row @ (model.a + by_state)
        if not np.max(np.abs(row)) < _ENOUGH * np.max(seen, initial=1e-300):
            break  # unstable at rest: later effects of a state come from the growth, not from the state itself
    known = np.isfinite(model.state_range) & (model.state_range > 0.0)
    unseen = np.where(known, model.state_range, 1.0 / np.max(seen, initial=1e-300) if np.any(seen) else 1.0)
    return np.divide(1.0, seen, out=unseen, where=seen > 0.0)
