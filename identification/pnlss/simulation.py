"""What a nonlinear state-space model makes of an input, and how far outside of what it knows that lies."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.pnlss.kernels import simulate, workspace
from identification.validation import finite_array

if TYPE_CHECKING:
    from identification.pnlss.model import PnlssModel

__all__ = ["Simulation", "simulated_run", "use_of"]

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Simulation:
    """A simulated run.

    Parameters
    ----------
    outputs
        float[n_outputs, n]; NaN from ``unbounded_at`` on.
    states
        float[n_states, n], those before each sample's input acts; NaN from ``unbounded_at`` on.
    state_use, input_use
        float[n_states], float[n_inputs]: largest magnitude over the largest in the training data; NaN where that is
        unknown, or zero: of what never moved nothing is known. Beyond one a model extrapolates, and polynomials do that badly.
    unbounded_at
        First sample at which states or outputs left all bounds; None if they never did.
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


def simulated_run(model: "PnlssModel", inputs: ArrayLike, initial_state: ArrayLike | None) -> Simulation:
    """What a model makes of inputs; see `PnlssModel.simulate`."""
    u = finite_array("inputs", inputs, np.float64, 2)
    if u.shape[0] != len(model.inputs):
        raise IdentificationError(f"inputs: shape {u.shape}, needs {len(model.inputs)} rows")
    begin = np.zeros(model.states) if initial_state is None else initial_state
    x0 = np.array(finite_array("initial_state", begin, np.float64, 1))
    if x0.size != model.states:
        raise IdentificationError(f"initial_state: has {x0.size} values, needs {model.states}")
    x, y = np.empty((u.shape[1], model.states)), np.empty((u.shape[1], len(model.outputs)))
    m, tables = model.matrices, (model.state_features.table, model.output_features.table)
    count = simulate(m, *tables, np.ascontiguousarray(u.T), x0, model.bound, workspace(m), x, y)
    x[count:], y[count:] = np.nan, np.nan
    return Simulation(
        outputs=y.T,
        states=x.T,
        state_use=use_of(np.max(np.abs(x[:count]), axis=0, initial=0.0), model.state_range),
        input_use=use_of(np.max(np.abs(u), axis=1, initial=0.0), model.input_range),
        unbounded_at=None if count == u.shape[1] else int(count),
    )
