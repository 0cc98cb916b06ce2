"""Bundles of a rig's arrays by their addresses: a caller of a kernel passes one table in place of some thirty arrays.

Each array that is passed from Python costs some 40 ns, and a sample of a rig less than a microsecond.
"""

import numpy as np
from numpy.typing import NDArray

from simulators.layout import CHANNEL, CONVERTER, PLANT, SITE, RigArrays, RigState
from vibrolock.array_at import array_at
from vibrolock.compiled import inner_kernel


def addressed(bundle: RigArrays | RigState) -> NDArray[np.int64]:
    """Return address and shape of each array [n_array, 4]; valid as long as the arrays live, for which the caller cares."""
    table = np.ones((len(bundle), 4), np.int64)
    for row, array in zip(table, bundle, strict=True):
        assert array.flags.c_contiguous
        row[0], row[1 : 1 + array.ndim] = array.ctypes.data, array.shape
    return table


@inner_kernel
def rig_at(t: NDArray[np.int64]) -> RigArrays:
    """Return the arrays of a rig from their addresses and shapes."""
    return RigArrays(
        plant=array_at(t[0, 0], t[0, 1], PLANT),
        step=array_at(t[1, 0], (t[1, 1], t[1, 2]), np.float64),
        correct=array_at(t[2, 0], (t[2, 1], t[2, 2]), np.float64),
        sites=array_at(t[3, 0], t[3, 1], SITE),
        elements=array_at(t[4, 0], (t[4, 1], t[4, 2], t[4, 3]), np.float64),
        stuck=array_at(t[5, 0], t[5, 1], np.float64),
        sense=array_at(t[6, 0], (t[6, 1], t[6, 2]), np.float64),
        channels=array_at(t[7, 0], t[7, 1], CHANNEL),
        conditioning=array_at(t[8, 0], (t[8, 1], t[8, 2]), np.float64),
        converter=array_at(t[9, 0], t[9, 1], CONVERTER),
        noise_keys=array_at(t[10, 0], t[10, 1], np.uint64),
        sections=array_at(t[11, 0], (t[11, 1], t[11, 2], t[11, 3]), np.float64),
        reconstruction=array_at(t[12, 0], (t[12, 1], t[12, 2]), np.float64),
        taps=array_at(t[13, 0], (t[13, 1], t[13, 2]), np.float64),
    )


@inner_kernel
def state_at(t: NDArray[np.int64]) -> RigState:
    """Return the state of a rig from the addresses and shapes of its arrays."""
    return RigState(
        inputs=array_at(t[0, 0], t[0, 1], np.float64),
        deflection=array_at(t[1, 0], t[1, 1], np.float64),
        increment=array_at(t[2, 0], t[2, 1], np.float64),
        friction=array_at(t[3, 0], (t[3, 1], t[3, 2]), np.float64),
        filters=array_at(t[4, 0], (t[4, 1], t[4, 2]), np.float64),
        counter=array_at(t[5, 0], t[5, 1], np.int64),
        memory=array_at(t[6, 0], (t[6, 1], t[6, 2], t[6, 3]), np.float64),
        output_memory=array_at(t[7, 0], (t[7, 1], t[7, 2]), np.float64),
        history=array_at(t[8, 0], (t[8, 1], t[8, 2]), np.float64),
        rows=array_at(t[9, 0], t[9, 1], np.float64),
        forces=array_at(t[10, 0], t[10, 1], np.float64),
        joints=array_at(t[11, 0], t[11, 1], np.float64),
        changes=array_at(t[12, 0], t[12, 1], np.float64),
        increments=array_at(t[13, 0], t[13, 1], np.float64),
        outputs=array_at(t[14, 0], t[14, 1], np.float64),
    )
