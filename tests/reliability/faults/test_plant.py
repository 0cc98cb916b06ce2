"""The hand in the wires: it does what the table of faults says, from its sample on, and nothing before."""

import numpy as np
import pytest

from rig.drivers.virtual import VirtualDAQ
from tests.reliability.faults.devices import VirtualRigInProcess
from tests.reliability.faults.plans import bench_for
from tests.reliability.faults.table import FAULTS

ONSET, BLOCKS, BLOCK = 1005, 200, 10  # within a block
BENCH = bench_for("V")
IN_THE_PLANT = [fault for fault in FAULTS if fault.part != "driver" and fault.onset == "middle"]


def driven(daq):
    """Readings [n, n_channels] of a tone near resonance, V."""
    with daq:
        daq.start(BLOCK)
        tone = 0.5 * np.sin(2.0 * np.pi * 24.4 * np.arange(BLOCKS * BLOCK) / BENCH.sample_rate_hz)
        return np.concatenate([daq.exchange(part) for part in tone.reshape(BLOCKS, BLOCK)])


@pytest.fixture(scope="module")
def whole():
    return driven(VirtualRigInProcess(BENCH, 3, None, 0, 0.5))


def test_without_a_fault_it_is_the_virtual_rig_bit_for_bit(whole):
    np.testing.assert_array_equal(whole, driven(VirtualDAQ(BENCH, 3)))


@pytest.mark.parametrize("fault", IN_THE_PLANT, ids=lambda fault: fault.name)
def test_a_fault_acts_from_its_sample_on_and_not_before(fault, whole):
    daq = VirtualRigInProcess(BENCH, 3, fault, ONSET, 0.5)
    seen = driven(daq)
    changed = np.flatnonzero((seen != whole).any(axis=1))
    # The structure's arrays are changed between blocks.
    first = ONSET if fault.part != "structure" else ONSET + BLOCK - ONSET % BLOCK
    assert first <= changed[0] <= first + 40
    others = [index for index, channel in enumerate(BENCH.channels) if channel.role != fault.part]
    if len(others) < len(BENCH.channels):
        touched = {daq.broken._index} | ({daq.broken.swapped_with} if fault.kind == "swapped" else set())
        others = [index for index in range(len(BENCH.channels)) if index not in touched]
        np.testing.assert_array_equal(seen[:, others], whole[:, others])
        np.testing.assert_array_equal(np.concatenate(daq.broken.true), whole)


@pytest.mark.parametrize("kind", ["softer", "softening"])
def test_a_softer_structure_goes_on_from_where_it_was(kind, whole):
    fault = next(fault for fault in FAULTS if fault.kind == kind and fault.onset == "middle")
    daq = VirtualRigInProcess(BENCH, 3, fault, ONSET, 0.5)
    driven(daq)
    displacement = np.concatenate(daq.broken.motion)[:, 1]
    assert np.abs(np.diff(displacement)).max() < 0.05 * np.abs(displacement).max()


def test_the_driver_in_memory_repeats_delays_skips_and_loses_blocks(whole):
    def seen(kind):
        fault = next(fault for fault in FAULTS if fault.part == "driver" and fault.kind == kind)
        return driven(VirtualRigInProcess(BENCH, 3, fault, ONSET - ONSET % BLOCK, 0.5))

    onset = ONSET - ONSET % BLOCK
    stale, repeats, skips, some = (seen(kind) for kind in ("stale", "repeats", "skips", "loses-some"))
    np.testing.assert_array_equal(stale[onset:], whole[onset - 50 : -50])
    np.testing.assert_array_equal(repeats[onset : onset + BLOCK], repeats[-BLOCK:])
    assert np.abs(skips[onset] - whole[onset]).max() > np.abs(whole[onset + 1] - whole[onset]).max()
    lost = np.isnan(some[onset:]).all(axis=1)
    assert lost.mean() == pytest.approx(1 / 20, abs=0.01)
    np.testing.assert_array_equal(some[onset:][~lost], whole[onset:][~lost])
