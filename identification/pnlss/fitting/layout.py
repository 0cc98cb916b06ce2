"""Data of the kernels of a fit: a system, its derivatives, and the work space of a recursion over time."""

from typing import NamedTuple

import numpy as np

from identification.pnlss.kernels import Table

__all__ = ["Room", "Slopes", "System", "room"]


class System(NamedTuple):
    """A model with its parameters: ``x(k+1) = [A B E] z``, ``y = [C D F] q`` with ``z = (x, u, phi)``, ``q = (x, u, chi)``."""

    state: np.ndarray
    """float[n_states, n_variables + n_state_features], [A B E]."""
    output: np.ndarray
    """float[n_outputs, n_variables + n_output_features], [C D F]."""
    state_table: Table
    output_table: Table


class Slopes(NamedTuple):
    """Derivatives of the monomials of a system, which are combinations of a few monomials."""

    table: Table
    """Monomials that occur in derivatives, of degree one and above."""
    coefficients: np.ndarray
    """float[n_monomials, (n_states + n_outputs) * n_states], coefficients in ``E d phi / d x`` and ``F d chi / d x``."""


class Room(NamedTuple):
    """State of the recursion from sample to sample, and its work arrays."""

    x: np.ndarray
    """float[n_states], the state before the next sample."""
    s: np.ndarray
    """float[2, n_states, n_columns], sensitivities of the state; between calls the first of the two is current."""
    z: np.ndarray
    q: np.ndarray
    slopes: np.ndarray
    """float[n_slopes], values of the monomials in derivatives."""
    effective: np.ndarray
    """float[(n_states + n_outputs) * n_states], ``A + E d phi / d x`` above ``C + F d chi / d x``."""
    back: np.ndarray
    """float[n_states], errors propagated back through the outputs."""
    gradient: np.ndarray
    """float[n_columns + n_output_weights], sum of derivatives times errors."""
    own_gradient: np.ndarray
    """float[n_outputs, n_output_columns], sum of derivatives times errors for [C D F]."""
    row: np.ndarray
    """float[n_output_weights], derivatives of an output with respect to the weights in its features."""
    state_steep: np.ndarray
    output_steep: np.ndarray


def room(system: System, slopes: Slopes, columns: int) -> Room:
    """Return the work space of a recursion with ``columns`` columns of sensitivities."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    return Room(
        np.zeros(n),
        np.zeros((2, n, columns)),
        np.zeros(system.state.shape[1]),
        np.zeros(system.output.shape[1]),
        np.zeros(len(slopes.coefficients)),
        np.zeros((n + outputs) * n),
        np.zeros(n),
        np.zeros(columns + system.output_table.weights.size),
        np.zeros((outputs, system.output.shape[1])),
        np.zeros(system.output_table.weights.size),
        np.zeros((system.state_table.weights.shape[0], 2)),
        np.zeros((system.output_table.weights.shape[0], 2)),
    )
