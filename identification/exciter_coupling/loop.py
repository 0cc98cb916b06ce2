"""Filter through which a force reacts to the motion, as compiled simulations take it."""

from typing import NamedTuple

import numpy as np


class Loop(NamedTuple):
    """Filter of a force that reacts on an output: ``xi(k+1) = A xi + b y_d``, ``F = F_0 + c xi + d y_d``."""

    a: np.ndarray
    """float[n_xi, n_xi]."""
    b: np.ndarray
    """float[n_xi]."""
    c: np.ndarray
    """float[n_xi]."""
    d: float
