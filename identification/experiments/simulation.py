"""Simulated response of a nonlinear state-space model, and how much of its trained range it uses."""

from dataclasses import dataclass

import numpy as np

from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False, kw_only=True)
class Simulation:
    """A simulated run.

    Parameters
    ----------
    outputs
        float[n_outputs, n]; NaN from ``unbounded_at`` on.
    states
        float[n_states, n], states before the input of each sample acts; NaN from ``unbounded_at`` on.
    state_use, input_use
        float[n_states], float[n_inputs]: largest magnitude over the largest in the training data; NaN where that is unknown
        or zero. Above one the model extrapolates, for which polynomials are unsuited.
    unbounded_at
        First sample at which states or outputs are unbounded; None if there is none.
    """

    outputs: Float
    states: Float
    state_use: Float
    input_use: Float
    unbounded_at: int | None = None

    @property
    def bounded(self) -> bool:
        """Whether the run stayed bounded."""
        return self.unbounded_at is None

    @property
    def range_use(self) -> float:
        """Largest of ``state_use`` and ``input_use``; inf for an unbounded run, NaN where nothing is known."""
        if not self.bounded:
            return float(np.inf)
        both = np.concatenate([self.state_use, self.input_use])
        return float(np.nanmax(both)) if np.any(np.isfinite(both)) else float(np.nan)


def use_of(largest: Float, trained: Float) -> Float:
    """Largest magnitudes over those in the training data; NaN where these are unknown or zero."""
    known = np.isfinite(trained) & (trained > 0.0)
    return np.asarray(np.divide(largest, trained, out=np.full(largest.shape, np.nan), where=known))
