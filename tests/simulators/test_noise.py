from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import integrate, stats

from simulators.layout import RigArrays, RigState
from simulators.plant.compilation import at_rest
from simulators.sensing.noise.kernels import EDGES, HEIGHTS, TAIL, normal
from simulators.stepping import run_open_loop, sample
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

N = 400_000
KEYS = (0, 1, 2, 2**63 + 12345)


@pytest.fixture(scope="module")
def numbers() -> np.ndarray:
    """Four keys [4, N], drawn sample by sample."""
    out = np.empty((4, N, 1))
    for key, column in zip(KEYS, out, strict=True):
        rig, state = _noise_alone(key)
        run_open_loop(rig, state, np.zeros(N), column)
    return out[..., 0]


def _noise_alone(key: int) -> tuple[RigArrays, RigState]:
    """A rig whose one reading is the standard normal numbers of a key."""
    sensor = _noisy()[0] | {"noise_rms": 1.0}
    rig, _ = ideal(sensors=[sensor], friction=()).build()
    rig.noise_keys[1] = key
    return rig, at_rest(rig)


def test_layers_of_the_ziggurat_have_one_area_and_end_at_the_top_of_the_density() -> None:
    area, _ = integrate.quad(lambda x: np.exp(-0.5 * x * x), TAIL, np.inf, epsabs=1e-15)
    area += TAIL * np.exp(-0.5 * TAIL**2)
    assert EDGES[:-1] * np.diff(np.concatenate([[0.0], HEIGHTS[1:]])) == pytest.approx(area, rel=1e-9)
    assert HEIGHTS[-1] == 1.0


def test_noise_has_the_moments_of_a_standard_normal(numbers: np.ndarray) -> None:
    for x in numbers:
        assert abs(x.mean()) < 4 / np.sqrt(N)
        assert abs(x.var() - 1.0) < 4 * np.sqrt(2 / N)
        assert abs(stats.skew(x)) < 4 * np.sqrt(6 / N)
        assert abs(stats.kurtosis(x)) < 4 * np.sqrt(24 / N)


def test_noise_has_the_distribution_of_a_standard_normal(numbers: np.ndarray) -> None:
    for x in numbers:
        assert stats.kstest(x, "norm").pvalue > 1e-3


@pytest.mark.parametrize("beyond", [2.0, 3.0, TAIL, 4.0])
def test_tails_of_the_noise_are_as_heavy_as_they_should_be(numbers: np.ndarray, beyond: float) -> None:
    for side in (numbers, -numbers):
        expected = numbers.size * stats.norm.sf(beyond)
        assert abs(np.sum(side > beyond) - expected) < 4 * np.sqrt(expected)


def test_tail_itself_has_the_distribution_of_a_normal_tail(numbers: np.ndarray) -> None:
    tail = np.abs(numbers[np.abs(numbers) > TAIL])
    assert stats.kstest(stats.norm.sf(tail) / stats.norm.sf(TAIL), "uniform").pvalue > 1e-3


def test_noise_is_independent_between_channels_and_samples(numbers: np.ndarray) -> None:
    columns = np.vstack([numbers[:, 2:], numbers[:, 1:-1], numbers[:, :-2]])
    for power in (1, 2):
        correlation = np.corrcoef(columns**power) - np.eye(12)
        # 66 numbers: five standard deviations are beyond chance.
        assert np.max(np.abs(correlation)) < 5 / np.sqrt(N)


def test_noise_is_white(numbers: np.ndarray) -> None:
    for x in numbers:
        power = np.abs(np.fft.rfft(x))[1:-1] ** 2 / N
        in_bands = power[: power.size // 100 * 100].reshape(100, -1).mean(axis=1)
        assert np.max(np.abs(in_bands - 1.0)) < 5 / np.sqrt(power.size / 100)


def test_number_depends_on_key_and_sample_alone() -> None:
    forward = [normal(np.uint64(7), k) for k in range(3000)]
    backward = [normal(np.uint64(7), k) for k in reversed(range(3000))]
    assert forward == backward[::-1]
    assert len(set(forward)) == 3000


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


def test_noise_of_sensor_and_converter_add_up_in_power() -> None:
    sensors = [_noisy()[0] | {"noise_rms": 3.0, "sensitivity_v_per_unit": 2.0}]
    rig, state = ideal(sensors=sensors, converter={"adc_noise_v": 8.0}).build(3)
    out_v = np.empty((20_000, 1))
    run_open_loop(rig, state, np.zeros(20_000), out_v)
    assert out_v.std() == pytest.approx(10.0, rel=4 / np.sqrt(40_000))


def test_noise_of_the_output_is_on_the_held_voltage() -> None:
    rig, state = ideal(converter={"dac_noise_v": 0.5}).build(3)
    held_v = []
    for _ in range(4000):
        sample(rig, state, 2.0, np.empty(4))
        held_v.append(state.inputs[rig.plant["n_state"][0]])
    assert np.mean(held_v) == pytest.approx(2.0, abs=4 * 0.5 / np.sqrt(4000))
    assert np.std(held_v) == pytest.approx(0.5, rel=4 / np.sqrt(8000))
