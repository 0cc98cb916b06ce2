"""Errors of a PNLSS model simulated with the inputs of experiments, and estimated initial states."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment
from identification.pnlss.fitting.checks import belongs, check_not_zero
from identification.pnlss.fitting.initial_states import SAMPLES, fitted_initial_state
from identification.pnlss.fitting.parameters import Parameters
from identification.pnlss.fitting.records import records_of
from identification.pnlss.model import PnlssModel
from identification.pnlss.simulators import Follower, SimulatedMotion, Simulator
from identification.validation import read_only
from vibrolock.arrays import Float

_ENOUGH = 1e3
"""The search for the sizes of states ends once the response of the outputs exceeds this multiple of the largest so far."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssErrors:
    """Errors of one model on experiments.

    Parameters
    ----------
    relative
        float[n_experiments, n_outputs], RMS of the output error over the RMS of the measured output, over the samples that
        count (Scheel et al., the relative error of Section 3.3); inf for an unbounded run.
    rms
        float[n_experiments, n_outputs], RMS of the output error in the units of the outputs.
    bounded
        bool[n_experiments], whether the run stayed bounded.
    range_use
        float[n_experiments], largest state or input over the largest in the training data; inf for an unbounded run, NaN
        where unknown.
    names
        One per experiment.
    levels
        float[n_experiments].
    """

    relative: Float
    rms: Float
    bounded: NDArray[np.bool_]
    range_use: Float
    names: tuple[str, ...]
    levels: Float

    def __post_init__(self) -> None:
        for name in ("relative", "rms", "range_use", "levels"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
        object.__setattr__(self, "bounded", read_only(self.bounded, np.bool_))

    @property
    def overall(self) -> Float:
        """float[n_experiments]: RMS over outputs of the relative errors."""
        return np.asarray(np.sqrt(np.mean(self.relative**2, axis=1)))

    @property
    def unbounded(self) -> int:
        """Number of unbounded runs."""
        return int(np.count_nonzero(~self.bounded))


def pnlss_errors(
    model: PnlssModel | Simulator, experiments: Sequence[Experiment], *, samples: int = SAMPLES
) -> PnlssErrors:
    """Simulate each experiment and compare; an initial state to be estimated is fitted to the first ``samples`` samples.

    A model of another kind begins from rest, or as it does itself (`identification.pnlss.simulators.Follower`).

    Raises `IdentificationError` if there are no experiments, their channels or sample rates differ from the model's, or an
    output is zero where it counts.
    """
    if not experiments:
        raise IdentificationError("experiments: none given, needs one at least")
    relative, rms = np.full((2, len(experiments), len(model.outputs)), np.inf)
    bounded, use = np.zeros(len(experiments), dtype=bool), np.full(len(experiments), np.inf)
    for index, experiment in enumerate(experiments):
        what = f"experiments[{index}]{f' ({experiment.name})' if experiment.name else ''}"
        belongs(model, experiment, what)
        check_not_zero(experiment, what)
        scale = np.max(np.abs(experiment.counted_outputs), axis=1)
        if isinstance(model, PnlssModel) and experiment.initial_state == "estimated":
            begin = estimated_initial_state(model, experiment, samples=samples)
            run: SimulatedMotion = model.simulate(experiment.inputs, initial_state=begin)
        elif isinstance(model, Follower):
            run = model.simulate_experiment(experiment)
        else:
            run = model.simulate(experiment.inputs)
        bounded[index], use[index] = run.unbounded_at is None, run.range_use
        if bounded[index]:
            with np.errstate(over="ignore"):
                errors = (run.outputs[:, experiment.counted_from :] - experiment.counted_outputs) / scale[:, None]
                rms[index] = scale * np.sqrt(np.mean(errors**2, axis=1))
            relative[index] = rms[index] / (
                scale * np.sqrt(np.mean((experiment.counted_outputs / scale[:, None]) ** 2, axis=1))
            )
    return PnlssErrors(
        relative=relative,
        rms=rms,
        bounded=bounded,
        range_use=use,
        names=tuple(e.name or f"experiment {index + 1}" for index, e in enumerate(experiments)),
        levels=np.array([e.level for e in experiments]),
    )


def estimated_initial_state(model: PnlssModel, experiment: Experiment, *, samples: int = SAMPLES) -> Float:
    """float[n_states] before the first sample, by least squares on the first ``samples`` that count, each output over its RMS.

    Unobservable combinations of states stay near zero. For this the states are scaled so that each alone has an equal effect
    on the outputs; the result then depends neither on the units of the states nor on a known range.

    Raises `IdentificationError` on other channels, another sample rate, too few samples.
    """
    belongs(model, experiment, f"experiment{f' ({experiment.name})' if experiment.name else ''}")
    if not samples * len(model.outputs) >= model.states:
        raise IdentificationError(f"samples: is {samples}, too few for {model.states} states")
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
