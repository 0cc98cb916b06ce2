"""Intervals of mode and channels as `rig tune` fits them, from responses of virtual rigs whose modes are given."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix
from rig.drivers import make_daq
from rig.tuning.plant import channel_ratios, plant_of, smoothed_std
from simulators.analysis import frequency_response
from tests.rig.rigs import bench_with

HERTZ, SHAPE, DAMPING = 24.0, 0.9, 0.004
OUTPUTS = ("force", "drive", "acc_magnet")


def bench_of(neighbour):
    """A rig with a second mode at ``neighbour`` times the frequency of the first, which moves the tip the other way."""
    shapes = {name: [SHAPE, 0.8 * SHAPE] for name in ("drive", "acc_drive")}
    shapes["acc_magnet"] = shapes["magnet"] = [1.6 * SHAPE, -1.2 * SHAPE]
    frequency_hz, damping_ratio = [HERTZ, neighbour * HERTZ], [DAMPING, DAMPING]
    structure = {"kind": "modal", "frequency_hz": frequency_hz, "damping_ratio": damping_ratio, "shapes": shapes}
    return bench_with({"specimen": {"linear_frequency_hz": HERTZ}}, structure=structure, elements=[], friction=[])


def responses(bench, noise, rng):
    """Responses per volt with circular noise, ``noise`` of each one's size at every line, and its covariance."""
    virtual = make_daq(bench).rig
    frequency = np.arange(0.4 * HERTZ, 2.5 * HERTZ, 0.005 * HERTZ)
    found = frequency_response(virtual, frequency)
    values = np.stack([found.force_n_per_v, *(found.sensor_per_v[name] for name in OUTPUTS[1:])], axis=1)
    std = noise * np.abs(values)
    white = rng.standard_normal((2, *values.shape)) / math.sqrt(2.0)
    units = {"force": "N"}
    channels = [
        Channel(name, role, units.get(name, "m/s^2"))
        for name, role in zip(OUTPUTS, ("force", "drive", "response"), strict=True)
    ]
    return FrequencyResponseMatrix(
        outputs=channels,
        inputs=[Channel("voltage", "monitor", "V")],
        frequency_hz=frequency,
        value=(values + std * (white[0] + 1j * white[1]))[:, :, None],
        total_covariance=np.einsum("ki,ij->kij", std**2, np.eye(3)).astype(np.complex128),
    )


@cache
def fitted(neighbour, seed, noise):
    """The responses of a rig with this noise, and the plant as it is found in them."""
    bench = bench_of(neighbour)
    matrix = responses(bench, noise, np.random.default_rng(seed))
    return matrix, plant_of(bench, matrix, 0.0)


def errors(neighbour, seeds, noise=1e-3):
    """Relative errors of frequency, damping, shape and ratio, and the stated ones, [seed, 2, 4]."""
    out = []
    true = np.array([2.0 * math.pi * HERTZ, DAMPING, SHAPE, 1.6])
    for seed in seeds:
        matrix, plant = fitted(neighbour, seed, noise)
        ratios, stds, _ = channel_ratios(matrix, plant)
        found = [plant.frequency_rad_s, plant.damping_ratio, plant.drive_shape, ratios["acc_magnet"]]
        std = [plant.frequency_std_rad_s, plant.damping_ratio_std, plant.drive_shape_std, stds["acc_magnet"]]
        out.append([np.array(found) / true - 1.0, np.array(std) / true])
    return np.array(out)


@pytest.mark.parametrize("neighbour", [pytest.param(6.0, marks=pytest.mark.slow), 2.0])
def test_the_intervals_hold_the_truth_with_a_neighbouring_mode_far_away_and_near(neighbour):
    error, std = np.moveaxis(errors(neighbour, range(6)), 1, 0)
    inside = np.abs(error) < 1.96 * std
    assert np.all(np.mean(inside, axis=0) > 0.6)  # 0.95 less four standard deviations of a share of six
    assert np.median(std[:, 2]) < 0.03


def test_a_mode_that_the_model_lacks_is_seen_by_the_narrower_fits():
    far, near = (errors(neighbour, [0], noise=1e-4)[0] for neighbour in (6.0, 2.0))
    assert near[1][2] > 5.0 * far[1][2]


@pytest.mark.parametrize(("turn_deg", "told"), [(0.0, None), (7.0, 7.0), (-12.0, -12.0), (187.0, 7.0), (0.4, None)])
def test_a_response_that_stands_off_a_real_mode_shape_is_measured(turn_deg, told):
    matrix, plant = fitted(6.0, 0, 1e-4)
    turned = matrix.value * np.exp(1j * np.radians([0.0, 0.0, turn_deg]))[None, :, None]
    found = channel_ratios(replace(matrix, value=turned), plant).turns_deg
    assert found == ({} if told is None else {"acc_magnet": pytest.approx(told, abs=0.1)})


def test_the_standard_error_of_a_line_is_pooled_with_those_beside_it_and_no_line_of_few_periods_decides():
    few = np.sqrt(np.random.default_rng(0).chisquare(2, (400, 2)) / 2.0)
    assert np.min(few) < 0.1
    pooled = smoothed_std(few)
    assert pooled.shape == few.shape
    assert np.all((pooled > 0.5) & (pooled < 1.6))
    for lines in (0, 1, 5, 30):
        np.testing.assert_allclose(smoothed_std(np.full((lines, 2), 0.3)), np.full((lines, 2), 0.3))
