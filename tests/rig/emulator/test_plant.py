"""The virtual rig behind a device's converters, stepped by blocks of any size."""

import numpy as np
import pytest

from rig.drivers import make_daq
from rig.drivers.virtual.kernels import Exchange
from rig.emulator import VirtualPlant
from rig.wire.messages import DeviceFlag
from tests.rig.rigs import bench_with

SEED = 3
VOLTAGES = np.random.default_rng(2).uniform(-0.5, 0.5, 240)


@pytest.fixture(scope="module")
def readings_v() -> np.ndarray:
    with make_daq(bench_with(), SEED) as daq:
        daq.start(VOLTAGES.size)
        return daq.exchange(VOLTAGES)


def measured_v(plant: VirtualPlant, *blocks: int) -> np.ndarray:
    """Readings in blocks of these sizes, one after the other and from the first again."""
    rows, first = [], 0
    while first < VOLTAGES.size:
        n = blocks[len(rows) % len(blocks)]
        counts, flags = plant.step(VOLTAGES[first : first + n])
        assert counts.shape == (n, 4)
        assert flags == 0
        rows.append(counts * plant.v_per_count)
        first += n
    return np.vstack(rows)


def test_a_specimen_that_wears_measures_the_same_behind_a_device() -> None:
    bench = bench_with(wear={"frequency_per_s": [-0.1], "until_s": 1.0, "every_s": 0.01})
    with make_daq(bench, SEED) as daq:
        daq.start(VOLTAGES.size)
        expected = daq.exchange(VOLTAGES)
    plant = VirtualPlant(bench, SEED)
    for blocks in ((1,), (60,), (7, 50, 3)):
        plant.reset()
        np.testing.assert_array_equal(measured_v(plant, *blocks), expected)


def test_every_start_with_the_same_or_another_block_measures_the_same(readings_v: np.ndarray) -> None:
    plant = VirtualPlant(bench_with(), SEED)
    for blocks in ((5,), (5,), (60,), (1,), (240,), (1,), (24,)):
        plant.reset()
        np.testing.assert_array_equal(measured_v(plant, *blocks), readings_v)


def test_blocks_may_change_their_size_on_the_way(readings_v: np.ndarray) -> None:
    plant = VirtualPlant(bench_with(), SEED)
    np.testing.assert_array_equal(measured_v(plant, 1, 20, 3, 16), readings_v)


def test_its_kernels_are_loaded_once_it_is_made(readings_v: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    exchanged: list[int] = []

    class Counting(Exchange):
        def __call__(self, first: int, voltages: np.ndarray, *arrays: np.ndarray) -> None:
            exchanged.append(voltages.size)
            super().__call__(first, voltages, *arrays)

    monkeypatch.setattr("rig.emulator.plant.Exchange", Counting)
    plant = VirtualPlant(bench_with(), SEED)
    assert exchanged == [1]
    np.testing.assert_array_equal(measured_v(plant, 60), readings_v)


def test_counts_that_were_handed_out_are_not_written_into_again() -> None:
    plant = VirtualPlant(bench_with(), SEED)
    first, _ = plant.step(VOLTAGES[:20])
    kept = first.copy()
    plant.step(VOLTAGES[20:40])
    np.testing.assert_array_equal(first, kept)


def test_an_output_beyond_the_converter_is_a_flag_of_its_block_alone() -> None:
    plant = VirtualPlant(bench_with(), SEED)
    raised = [plant.step(np.array([0.0, volts]))[1] for volts in (0.1, 1000.0, 0.1)]
    assert [bool(flags & DeviceFlag.OUTPUT_CLIPPED) for flags in raised] == [False, True, False]
