"""Convert a model to one parameter vector and back."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.models.pnlss.features import with_weights
from identification.models.pnlss.fitting.kernels import System
from identification.models.pnlss.kernels import Matrices, Table
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False)
class Parameters:
    """Layout of the vector: first the parameters that all outputs share, then those of each output.

    The shared parameters are [A B E] row by row, the weights in the state features row by row, those in the output features,
    and the estimated initial states of experiments. The own parameters of the outputs are [C D F] row by row.
    """

    start: PnlssModel
    """A model of the same structure, which supplies everything that is not a parameter."""
    estimated: int = 0
    """Number of experiments with an estimated initial state."""

    @cached_property
    def tables(self) -> tuple[Table, Table]:
        """Features of states and outputs; their weights are parameters."""
        return self.start.state_features.table, self.start.output_features.table

    @cached_property
    def ends(self) -> list[int]:
        """End indices of [A B E], the weights of state and output features, the initial states, and [C D F] in the vector."""
        start, n, variables = self.start, self.start.states, self.start.state_features.variables
        sizes = [
            n * (variables + start.state_features.count),
            start.state_features.parameters,
            start.output_features.parameters,
            n * self.estimated,
            len(start.outputs) * (variables + start.output_features.count),
        ]
        return [int(end) for end in np.cumsum(sizes)]

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.ends[-1]

    @property
    def linear(self) -> int:
        """Number of elements of [A B E]."""
        return self.ends[0]

    @property
    def shared(self) -> int:
        """Number of parameters that all outputs share."""
        return self.ends[3]

    @cached_property
    def nonlinear(self) -> Float:
        """float[count], 1 for elements of E and F, else 0."""
        marks = np.zeros(self.count)
        variables = self.start.state_features.variables
        marks[: self.linear].reshape(self.start.states, -1)[:, variables:] = 1.0
        marks[self.shared :].reshape(len(self.start.outputs), -1)[:, variables:] = 1.0
        return marks

    def onto(self, begin: Float) -> Float:
        """Return the derivatives of an experiment's columns with respect to the shared parameters, and one column for errors.

        float[n_columns, shared + 1], for columns as in `fitting.blocks.Blocks`. ``begin`` (float[n_states,
        shared + 1]) are the derivatives of the state with which its samples begin; without rows if that is constant.
        """
        inner_state, inner_output, n = self.ends[1], self.ends[2] - self.ends[1], len(begin)
        found = np.zeros((inner_state + n + inner_output + 1, self.shared + 1))
        found[:inner_state, :inner_state] = np.eye(inner_state)
        found[inner_state : inner_state + n] = begin
        found[inner_state + n : -1, inner_state : self.ends[2]] = np.eye(inner_output)
        found[-1, -1] = 1.0
        return found

    def begin_derivatives(self, place: int | None) -> Float:
        """float[n_states, shared + 1]: derivatives of the initial state of the experiment at ``place``; no rows for None."""
        n = self.start.states
        return np.zeros((0, self.shared + 1)) if place is None else np.eye(n, self.shared + 1, self.ends[2] + place * n)

    def own(self, output: int) -> slice:
        """Return the slice of the parameters of one output."""
        width = (self.count - self.shared) // len(self.start.outputs)
        return slice(self.shared + output * width, self.shared + (output + 1) * width)

    def vector(self, model: PnlssModel, initial_states: Float) -> Float:
        """float[count]: parameters of a model of this structure and initial states float[estimated, n_states]."""
        parts = (
            np.hstack([model.a, model.b, model.e]),
            model.state_features.weights,
            model.output_features.weights,
            initial_states,
            np.hstack([model.c, model.d, model.f]),
        )
        return np.concatenate([np.ravel(part) for part in parts])

    def system(self, vector: Float) -> System:
        """Return the model with these parameters in the form that the kernels use."""
        linear, inner_state, inner_output, _, own = np.split(vector, self.ends[:-1])
        state, output = self.tables
        return System(
            linear.reshape(self.start.states, -1),
            own.reshape(len(self.start.outputs), -1),
            with_weights(state, inner_state.reshape(state.weights.shape)),
            with_weights(output, inner_output.reshape(output.weights.shape)),
        )

    def initial_states(self, vector: Float) -> Float:
        """float[estimated, n_states]: estimated initial states."""
        return vector[self.ends[2] : self.ends[3]].reshape(-1, self.start.states)

    def model(self, vector: Float) -> PnlssModel:
        """Return the model with these parameters."""
        system, start, n = self.system(vector), self.start, self.start.states
        ends = (n, start.state_features.variables)
        parts = (part for matrix in (system.state, system.output) for part in np.split(matrix, ends, axis=1))
        return replace(
            start,
            **Matrices(*map(np.ascontiguousarray, parts))._asdict(),
            state_features=replace(start.state_features, weights=system.state_table.weights),
            output_features=replace(start.output_features, weights=system.output_table.weights),
        )
