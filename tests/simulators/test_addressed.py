"""A rig by the addresses of its arrays is the same rig."""

import numpy as np

from simulators.kernels import addressed, rig_at, run_open_loop, state_at
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Float
from vibrolock.compiled import kernel


@kernel
def run_at(rig: np.ndarray, state: np.ndarray, voltages: Float, out_v: Float) -> int:
    return run_open_loop(rig_at(rig), state_at(state), voltages, out_v)


def test_a_run_by_addresses_reads_and_leaves_what_one_with_the_arrays_does() -> None:
    rig = VirtualRig.shipped("friction-beam")
    voltages = np.sin(2.0 * np.pi * 149.0 / 5000.0 * np.arange(200))
    (arrays, state), (others, other) = rig.build(3), rig.build(3)
    readings_v, others_v = np.empty((2, 200, len(rig.sensors)))
    flags = run_open_loop(arrays, state, voltages, readings_v)
    assert run_at(addressed(others), addressed(other), voltages, others_v) == flags
    assert np.array_equal(others_v, readings_v)
    for ours, theirs in zip(state, other, strict=True):
        assert np.array_equal(ours, theirs)


def test_the_table_has_address_and_shape_of_each_array() -> None:
    arrays, state = VirtualRig.shipped("magnet-beam").build()
    for bundle in (arrays, state):
        for (address, *shape), array in zip(addressed(bundle), bundle, strict=True):
            assert address == array.ctypes.data
            assert tuple(shape[: array.ndim]) == array.shape
