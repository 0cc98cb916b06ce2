"""Simulated response of a model, and how much of its trained range it uses."""

from dataclasses import dataclass, field

import numpy as np

from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False, kw_only=True)
class Simulation:
    """A simulated run of any model, alone or with an exciter.

    Parameters
    ----------
    outputs
        float[n_outputs, n]; not finite from ``unbounded_at`` on.
    states
        float[n_states, n], states before the input of each sample acts; not finite from ``unbounded_at`` on.
    state_use, input_use
        float[n], largest magnitude of each state (each nonlinear element of a structured model) and of each input over the
        largest in the training data; NaN where that is unknown or zero. Above one the model extrapolates.
    unbounded_at
        First sample at which states or outputs are unbounded; None if there is none.
    force_n
        float[n], force at the model's input in a run with an exciter; NaN from ``unbounded_at`` on. Empty without one.
    passes
        Number of passes over a run with an exciter.
    change
        RMS change of the force in the last pass over the RMS force; NaN for an unbounded run, or without an exciter.
    notes
        Remarks on this run, one line each.
    """

    outputs: Float
    states: Float
    state_use: Float
    input_use: Float = field(default_factory=lambda: np.zeros(0))
    unbounded_at: int | None = None
    force_n: Float = field(default_factory=lambda: np.zeros(0))
    passes: int = 0
    change: float = float("nan")
    notes: tuple[str, ...] = ()

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


def first_unbounded(outputs: Float) -> int | None:
    """Return the first sample at which an output is not finite; None if there is none."""
    wrong = ~np.all(np.isfinite(outputs), axis=0)
    return int(np.argmax(wrong)) if wrong.any() else None
