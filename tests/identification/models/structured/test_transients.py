"""Transients in data that are called periodic: closed forms of a decaying sine in the periods, and of noise."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, Experiment
from identification.experiments import period_change
from identification.models.structured.transients import own_change, transient_factor

SIZE, RATE_HZ, DECAY_1_S = 400, 200.0, 0.4
FORCE, DRIVE = Channel("force", "force", "N"), Channel("drive", "drive", "m/s2")
TIME_S = np.arange(SIZE) / RATE_HZ
LEFT = np.exp(-DECAY_1_S * SIZE / RATE_HZ)
"""What is left of the transient after a period."""


def record(count: int, transient: float, noise: float = 0.0, seed: int = 0) -> Experiment:
    """The mean of ``count`` periods of a multisine and twice as much at the output, with a decay of 7 Hz and noise."""
    random = np.random.default_rng(seed)
    lines = np.zeros(SIZE // 2 + 1, complex)
    lines[5:60] = np.exp(2j * np.pi * random.random(55))
    force = np.tile(np.fft.irfft(lines) * SIZE, count)
    time_s = np.arange(count * SIZE) / RATE_HZ
    drive = 2.0 * force + transient * np.exp(-DECAY_1_S * time_s) * np.cos(2.0 * np.pi * 7.0 * time_s)
    return Experiment(
        inputs=force[None],
        outputs=(drive + noise * random.standard_normal(drive.size))[None],
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=(DRIVE,),
        period_samples=SIZE,
    ).averaged()


def rows_of(one: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Rows with two numbers (a sine and a cosine of 7 Hz that decay), no error of steps, the residual; and the change."""
    turned = np.exp((2j * np.pi * 7.0 - DECAY_1_S) * TIME_S)
    found = 2.0 * one.counted_inputs.T
    left = found[:, 0] - one.counted_outputs[0]
    return np.column_stack([turned.real, turned.imag, 0.0 * left, left]), own_change(one, found)[:, 0]


@pytest.mark.parametrize("count", [2, 5])
def test_the_transient_in_the_mean_is_told_from_the_change_of_the_periods(count: int) -> None:
    one = record(count, transient=1e-2, noise=1e-5)
    part, change = rows_of(one)
    moved = transient_factor(part, change, one, DECAY_1_S) * np.linalg.lstsq(part[:, :2], change, rcond=None)[0]
    expected = 1e-2 * np.mean(LEFT ** np.arange(count))
    assert moved[0] == pytest.approx(expected, rel=0.05)


def test_noise_alone_is_no_transient() -> None:
    records = [record(3, transient=0.0, noise=1e-2, seed=seed) for seed in range(200)]
    factors = [transient_factor(*rows_of(one), one, DECAY_1_S) for one in records]
    assert np.count_nonzero(factors) <= 8  # 1 % of them expected


def test_a_change_that_the_input_explains_is_none_of_the_structure() -> None:
    one = record(2, transient=0.0)
    assert one.period_change is not None
    moved = 0.01 * one.counted_inputs
    shifted = replace(one, period_change=one.period_change._replace(values=np.vstack([moved, 2.0 * moved])))
    found = 2.0 * one.counted_inputs.T
    np.testing.assert_allclose(own_change(shifted, found), 0.0, atol=1e-12 * np.abs(found).max())


def test_a_single_period_tells_no_change() -> None:
    assert period_change(np.zeros((2, 1, SIZE))) is None
