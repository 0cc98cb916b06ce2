"""A fit in scaled variables: its cost and normal equations at given parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.fitting.threads import threads
from identification.fitting.truncated_steps import TruncatedSteps
from identification.models.pnlss.fitting.blocks import PRIOR, fitted_initial_state
from identification.models.pnlss.fitting.frequency_lines import with_lines
from identification.models.pnlss.fitting.kernels import System
from identification.models.pnlss.fitting.normal_equations import NormalEquations, normal_equations
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import Record, records_of, simulated
from identification.models.pnlss.fitting.result import FitSettings
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_REMEMBERED = 3
"""Vectors of which the error is kept: that of an accepted step is asked for again, after at most two further trials."""


@dataclass(frozen=True, eq=False)
class Scales:
    """Units of the fit: RMS of the states of the start, and of inputs and outputs in the training data."""

    states: Float
    inputs: Float
    outputs: Float

    def model(self, model: PnlssModel) -> PnlssModel:
        """Return a model in these units."""
        return model.scaled(states=self.states, inputs=self.inputs, outputs=self.outputs)

    def physical(self, model: PnlssModel) -> PnlssModel:
        """Invert `model`."""
        return model.scaled(states=1.0 / self.states, inputs=1.0 / self.inputs, outputs=1.0 / self.outputs)


def scales_of(experiments: Sequence[Experiment], states: Float) -> Scales:
    """Return the scales of inputs and outputs over the counted parts of experiments, with the given scales of the states."""
    inputs = np.concatenate([e.counted_inputs for e in experiments], axis=1)
    outputs = np.concatenate([e.counted_outputs for e in experiments], axis=1)
    return Scales(states, _rms(inputs), _rms(outputs))


def _rms(rows: Float) -> Float:
    largest = np.max(np.abs(rows), axis=1, keepdims=True)
    scale = np.where(largest > 0.0, largest, 1.0)
    return np.asarray(scale[:, 0] * np.sqrt(np.mean((rows / scale) ** 2, axis=1)))


class Problem:
    """Training and validation data, and the cost of a fit.

    The cost is the sum of weighted squared errors over experiments, outputs and samples (or lines), relative to the sum of
    the squared outputs, plus a ridge.
    """

    def __init__(
        self,
        parameters: Parameters,
        scales: Scales,
        experiments: Sequence[Experiment],
        validation: Sequence[Experiment],
        settings: FitSettings,
    ) -> None:
        rate_hz = experiments[0].sample_rate_hz
        self.parameters, self.settings = parameters, settings
        both = (scales.inputs, scales.outputs)
        self.training = with_lines(records_of(experiments, *both), settings, rate_hz)
        self.validation = with_lines(records_of(validation, *both, "validation"), settings, rate_hz)
        rms = settings.outputs == "rms"
        self.weights = np.ones_like(scales.outputs) if rms else scales.outputs / np.max(scales.outputs)
        self._errors: dict[bytes, float] = {}
        self._total = self._measured(self.training)
        self._ridge = settings.ridge * parameters.nonlinear
        self._held = np.zeros(parameters.count)
        self._held[parameters.ends[2] : parameters.ends[3]] = PRIOR / self._total
        self._validation_total = self._measured(self.validation)
        if self.validation and not self._validation_total > 0.0:
            raise IdentificationError("its outputs are zero at all frequencies that count", field="validation")

    def _measured(self, records: list[Record]) -> float:
        return sum(record.weight * float(self.weights**2 @ record.squares(record.y)) for record in records)

    def _squares(self, system: System, record: Record, begin: Float) -> float:
        run = simulated(system, record.u, begin)
        if run is None:
            return float(np.inf)
        squares = record.weight * float(self.weights**2 @ record.squares(run[1] - record.y))
        return squares if np.isfinite(squares) else float(np.inf)

    def training_error(self, vector: Float) -> float:
        """Relative RMS error over all training data; inf if a run is unbounded."""
        key = vector.tobytes()
        if key not in self._errors:
            self._errors = {**dict(list(self._errors.items())[-_REMEMBERED:]), key: self._simulated_error(vector)}
        return self._errors[key]

    def _simulated_error(self, vector: Float) -> float:
        if not np.all(np.isfinite(vector)):
            return float(np.inf)
        system, begins = self.parameters.system(vector), self.parameters.initial_states(vector)
        rest, total = np.zeros(len(system.state)), 0.0
        for record in self.training:
            total += self._squares(system, record, rest if record.place is None else begins[record.place])
            if not np.isfinite(total):
                return float(np.inf)
        return float(np.sqrt(total / self._total))

    def validation_error(self, vector: Float) -> float:
        """Relative RMS error over all validation data, initial states estimated for this model; NaN without such data."""
        if not self.validation:
            return float(np.nan)
        system, total = self.parameters.system(vector), 0.0
        for record in self.validation:
            rest = np.zeros(len(system.state))
            begin = rest if record.place is None else fitted_initial_state(system, record, self.weights)
            total += self._squares(system, record, begin)
        return float(np.sqrt(total / self._validation_total))

    def cost(self, vector: Float) -> float:
        """Return the squared relative error plus the ridge; inf if a run is unbounded."""
        with threads():
            error = self.training_error(vector)
        return error**2 + float(self._ridge @ vector**2) if np.isfinite(error) else float(np.inf)

    def equations(self, vector: Float, count: int = 1) -> NormalEquations:
        """Return the normal equations of half of `cost`; a small weight keeps unobservable initial states near zero."""
        found = normal_equations(self.parameters, vector, self.training, self.weights, count)
        hessian, gradient = found.hessian / self._total, found.gradient / self._total
        return NormalEquations(hessian + np.diag(self._ridge + self._held), gradient + self._ridge * vector)

    def linearised(self, vector: Float) -> TruncatedSteps | None:
        """Return the steps from a vector; None if sensitivities are not finite.

        n_states^2 directions change no output; they are among those that the steps leave out.
        """
        with threads() as count:
            found = self.equations(vector, count)
            if not (np.all(np.isfinite(found.hessian)) and np.all(np.isfinite(found.gradient))):
                return None
            return TruncatedSteps(found.hessian, found.gradient, vector, self.cost(vector), self.settings.truncation)
