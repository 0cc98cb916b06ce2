"""Where a frequency response folds back: the branch that is unstable unless a loop holds its phase."""

import numpy as np
from numpy.typing import NDArray

RESOLVED = 2e-5
"""Smallest relative fall of the frequency between points that counts: less is within the scatter of a measurement."""


def folds_back(frequency_hz: NDArray[np.float64], phase_lag_deg: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return bool[n - 1]: whether the response folds back between a point and the next, float[n] each.

    Along a response at constant force, the phase lag rises from 0 to 180 deg through resonance. Where the frequency rises with
    it, the vibration is stable for itself. Between two fold points (``dW/dlag = 0``) the frequency falls while the lag rises:
    one real eigenvalue of the slow dynamics has crossed zero there (saddle-node), and a test that steps or sweeps the frequency
    jumps past this branch (A. H. Nayfeh and D. T. Mook, *Nonlinear Oscillations*, 1979, section 4.1.1). A loop that holds the
    lag makes it stable. The criterion concerns the curve alone, so it holds for hardening and softening structures, with the
    level held that the curve belongs to; it knows nothing of the exciter, and nothing of other instabilities.
    """
    change, lag = np.diff(frequency_hz), np.diff(phase_lag_deg)
    return np.asarray(change * np.sign(lag) < -RESOLVED * frequency_hz[:-1])
