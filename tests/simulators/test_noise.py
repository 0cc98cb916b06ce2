from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from simulators.kernels import run_open_loop
from simulators.layout import RigState
from simulators.sensing.kernels import normal_pair
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

N = 40_000


@pytest.fixture(scope="module")
def pairs() -> np.ndarray:
    return np.array([[*normal_pair(np.uint64(key), k)] for key in (1, 2) for k in range(N)]).reshape(2, N, 2)


def test_noise_is_standard_normal(pairs: np.ndarray) -> None:
    for numbers in (pairs[0, :, 0], pairs[0, :, 1], pairs[1, :, 0], pairs[1, :, 1]):
        assert abs(numbers.mean()) < 4 / np.sqrt(N)
        assert abs(numbers.var() - 1.0) < 4 * np.sqrt(2 / N)
        assert stats.kstest(numbers, "norm").pvalue > 1e-3


def test_noise_is_independent_between_channels_pairs_and_samples(pairs: np.ndarray) -> None:
    columns = np.column_stack([pairs[0], pairs[1]])
    shifted = np.column_stack([columns[1:], columns[:-1]])
    correlation = np.corrcoef(shifted, rowvar=False) - np.eye(8)
    # The same samples stand in both halves of the table, shifted by one: 28 numbers, five standard deviations.
    assert np.max(np.abs(correlation)) < 5 / np.sqrt(N)
    squares = np.corrcoef(columns**2, rowvar=False) - np.eye(4)
    assert np.max(np.abs(squares)) < 5 / np.sqrt(N)


def test_readings_of_a_rig_at_rest_have_the_noise_that_was_asked_for() -> None:
    table = ideal().model_dump()
    for sensor, rms in zip(table["sensors"], (0.3, 1.0, 2.0, 0.0), strict=True):
        sensor["noise_rms"] = rms
    rig, state = VirtualRig.model_validate(table).build(7)
    out_v = np.empty((20_000, 4))
    run_open_loop(rig, state, np.zeros(20_000), out_v)
    assert out_v.std(axis=0) == pytest.approx([0.3, 1.0, 2.0, 0.0], rel=0.02)


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 500), max_size=6), seed=st.integers(0, 2**32))
def test_samples_do_not_depend_on_the_blocks_they_come_in(cuts: list[int], seed: int) -> None:
    rig, whole_state = VirtualRig.shipped("magnet-beam").build(seed)
    voltages = np.sin(0.03 * np.arange(500))
    whole, blocks = np.empty((500, 4)), np.empty((500, 4))
    state = RigState(*(array.copy() for array in whole_state))
    run_open_loop(rig, whole_state, voltages, whole)
    edges = [0, *sorted(cuts), 500]
    for first, last in pairwise(edges):
        run_open_loop(rig, state, voltages[first:last], blocks[first:last])
    assert np.array_equal(whole, blocks)
    assert state.counter[0] == 500


def test_seeds_differ_and_the_same_seed_repeats() -> None:
    outs = []
    for seed in (1, 2, 1):
        rig, state = VirtualRig.shipped("magnet-beam").build(seed)
        outs.append(np.empty((200, 4)))
        run_open_loop(rig, state, np.zeros(200), outs[-1])
    assert np.array_equal(outs[0], outs[2])
    assert not np.array_equal(outs[0], outs[1])


def test_another_channel_leaves_the_noise_of_the_others_as_it_was() -> None:
    outs = []
    for sensors in (_noisy(), [*_noisy(), _noisy()[1] | {"name": "tip", "at": "tip"}]):
        rig_model = ideal(sensors=sensors)
        rig, state = rig_model.build(3)
        outs.append(np.empty((200, len(rig_model.sensors))))
        run_open_loop(rig, state, np.zeros(200), outs[-1])
    assert np.array_equal(outs[0], outs[1][:, :4])
    assert np.any(outs[1][:, 4] != 0.0)


def test_noise_scale_multiplies_the_noise() -> None:
    outs = []
    for scale in (1.0, 10.0):
        rig, state = ideal(noise_scale=scale, sensors=_noisy()).build(3)
        outs.append(np.empty((100, 4)))
        run_open_loop(rig, state, np.zeros(100), outs[-1])
    assert outs[1] == pytest.approx(10.0 * outs[0], rel=1e-12)


def _noisy() -> list[dict[str, object]]:
    return [sensor.model_dump() | {"noise_rms": 1.0} for sensor in ideal().sensors]
