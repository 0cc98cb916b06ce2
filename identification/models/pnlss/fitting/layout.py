"""A system in the form that the kernels of a fit use, and its linearisation."""

from typing import NamedTuple

import numpy as np

from identification.models.pnlss.kernels import Table
from vibrolock.arrays import Float


class System(NamedTuple):
    """A model with its parameters: ``x(k+1) = [A B E] z``, ``y = [C D F] q`` with ``z = (x, u, phi)``, ``q = (x, u, chi)``."""

    state: np.ndarray
    """float[n_states, n_variables + n_state_features], [A B E]."""
    output: np.ndarray
    """float[n_outputs, n_variables + n_output_features], [C D F]."""
    state_table: Table
    output_table: Table

    @property
    def alike(self) -> bool:
        """Whether states and outputs have the same features."""
        return all(map(np.array_equal, self.state_table, self.output_table))


class Slopes(NamedTuple):
    """``A + E d phi / d x`` above ``C + F d chi / d x`` as a combination of few values; of n_effective elements."""

    linear: np.ndarray
    """float[n_effective], A above C, row by row."""
    products: Table
    """Monomials that occur in derivatives, of degree one and above."""
    by_product: np.ndarray
    """float[n_monomials, n_effective]."""
    by_function: np.ndarray
    """float[n_functions, n_effective], coefficients of the slopes of functions, of states first."""


def slopes_of(system: System, weights: Float) -> Slopes:
    """Return the linearisation of a system whose outputs are multiplied by ``weights``, with as few monomials as possible.

    The derivatives of a cubic model need few products, however many monomials it has.
    """
    n, variables = system.state.shape[0], system.state_table.limits.size
    whole = np.concatenate([system.state[:, :n], weights[:, None] * system.output[:, :n]])
    products: dict[tuple[int, ...], Float] = {}
    functions: list[Float] = []
    for first, matrix, table in (
        (0, system.state, system.state_table),
        (n, weights[:, None] * system.output, system.output_table),
    ):
        here = slice(first, first + len(matrix))
        for index, row in enumerate(table.factors):
            factors = [int(j) for j in row if j >= 0]
            for position, j in enumerate(factors):
                if j >= n:
                    continue
                rest = tuple(factors[:position] + factors[position + 1 :])
                products.setdefault(rest, np.zeros(whole.shape))[here, j] += matrix[:, variables + index]
        for index, row in enumerate(table.weights):
            functions.append(np.zeros(whole.shape))
            functions[-1][here] = np.outer(matrix[:, variables + len(table.factors) + index], row[:n])
    degree = max((len(rest) for rest in products), default=0)
    padded = [(*rest, *[-1] * (degree - len(rest))) for rest in products]
    table = Table(
        np.array(padded, dtype=np.int64).reshape(len(products), degree),
        np.minimum(system.state_table.limits, system.output_table.limits),
        np.zeros((0, variables + 1)),
        np.zeros(0),
        np.zeros(0, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
    )
    return Slopes(
        whole.ravel(),
        table,
        np.array(list(products.values())).reshape(-1, whole.size),
        np.array(functions).reshape(-1, whole.size),
    )
