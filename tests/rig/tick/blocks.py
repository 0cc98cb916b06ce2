"""What a device says beside its samples, for ticks that are called without one."""

import numpy as np

from rig.daq import CONTINUATION


def nothing_told(n: int) -> tuple[np.ndarray, np.ndarray]:
    """``put_out`` of a device that has put out what was sent [n], and a ``continuation`` to fill."""
    return np.full(n, np.nan), np.zeros(1, CONTINUATION)
