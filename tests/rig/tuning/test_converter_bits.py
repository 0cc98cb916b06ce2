"""Rounding in the converters, as a force away from the frequency of the output."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from rig.campaigns.evaluation.acceptance import nonharmonic_objection
from rig.campaigns.evaluation.nonharmonic_force import HIGHEST_ORDER
from rig.tuning.converter_bits import OutputBits, output_bits, periodic_beyond, rounding
from rig.tuning.levels import lowest_force
from tests.rig.rigs import bench_with
from tests.rig.tuning.tuned import tuned_once

RNG = np.random.default_rng(4)


@pytest.fixture(autouse=True)
def draws_of_its_own(monkeypatch):
    """Each test draws the same numbers, whatever has run before it."""
    monkeypatch.setattr(sys.modules[__name__], "RNG", np.random.default_rng(4))


def test_rounding_a_sine_of_many_bits_errs_by_a_bit_over_the_root_of_twelve():
    turns = np.arange(200_000) * 0.0123456789
    sine = 2000.3 * np.sin(2.0 * np.pi * turns)
    assert np.std(np.round(sine) - sine) == pytest.approx(rounding(1.0), rel=0.08)


@pytest.mark.parametrize("noise", [0.2, 0.3])
def test_noise_in_front_of_a_converter_leaves_no_more_lines_than_said(noise):
    turns = np.arange(2_000) * 0.0123
    sine = 37.3 * np.sin(2.0 * np.pi * turns)
    rounded = np.mean([np.round(sine + RNG.normal(0.0, noise, sine.size)) for _ in range(4000)], axis=0)
    assert np.std(rounded - sine) < 1.1 * rounding(1.0, noise) + noise / math.sqrt(4000.0)
    assert rounding(1.0, noise) < 0.5 * rounding(1.0)


def test_the_output_s_error_reaches_the_force_by_the_responses():
    bench = bench_with()
    frequency = np.linspace(10.0, 60.0, 501)
    flat = SimpleNamespace(frequency_hz=frequency, value=np.full((501, 2, 1), 4.0 + 0.0j))
    inside = 4.0 * bench.output_bit_v / math.sqrt(12.0) * math.sqrt(50.0 / (0.5 * bench.sample_rate_hz))
    assert output_bits(bench, flat, 0.0).plain_n == pytest.approx(inside, rel=1e-3)
    whole = 4.0 * bench.output_bit_v / math.sqrt(12.0)
    assert output_bits(bench, flat, math.inf).plain_n == pytest.approx(whole, rel=1e-3)


def test_an_error_that_is_fed_back_reaches_the_force_as_its_spectrum_says():
    """Against a rounded sine, sample by sample, up to the highest line that counts."""
    bench = bench_with()
    frequency = np.linspace(10.0, 60.0, 501)
    flat = SimpleNamespace(frequency_hz=frequency, value=np.full((501, 2, 1), 4.0 + 0.0j))
    n, rate_hz, bit = 2**18, bench.sample_rate_hz, bench.output_bit_v
    sine = 700.3 * bit * np.sin(2.0 * np.pi * 24.3217 * np.arange(n) / rate_hz)
    error, errors = 0.0, np.empty(n)
    for k, value in enumerate(sine):
        rounded = bit * math.floor((value + error) / bit + 0.5)
        error += value - rounded
        errors[k] = rounded - value
    at_hz, power = np.fft.rfftfreq(n, 1.0 / rate_hz), 2.0 * np.abs(np.fft.rfft(errors)) ** 2 / n**2
    inside = 4.0 * math.sqrt(power[(at_hz > 10.0) & (at_hz < 60.0)].sum())
    counted = 4.0 * math.sqrt(power[at_hz < HIGHEST_ORDER * bench.specimen.linear_frequency_hz].sum())
    assert output_bits(bench, flat, 0.0).shaped_n == pytest.approx(inside, rel=0.3)
    assert (
        0.8 * counted < output_bits(bench, flat, math.inf).shaped_n < 3.0 * counted
    )  # a bound: all of it as at the end
    assert inside < 0.2 * output_bits(bench, flat, 0.0).plain_n


def test_the_least_bit_is_that_of_16_bit_where_the_bench_names_none():
    assert bench_with().output_bit_v == pytest.approx(20.0 / 65536.0)
    assert bench_with({"output_resolution_v": 0.01}).output_bit_v == 0.01


def test_what_repeats_above_a_line_is_told_from_noise_and_from_what_is_below():
    n = 4096
    period = 2.0 * np.pi * np.arange(n) / n
    once = 3.0 * np.cos(20 * period) + 0.5 * np.cos(300 * period)
    values = np.tile(once, 2) + RNG.normal(0.0, 0.2, 2 * n)
    assert periodic_beyond(values, n, 100.0) == pytest.approx(0.5 / math.sqrt(2.0), rel=0.05)


def test_an_objection_names_the_output_s_bits_where_they_are_few():
    assert "12 steps of its converter" in nonharmonic_objection(0.2, 0.1, 12.0)
    assert "steps" not in nonharmonic_objection(0.2, 0.1, 5000.0)
    assert nonharmonic_objection(0.05, 0.1, 12.0) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "shaped"),
    [
        ({}, True),
        ({"driver": {"name": "serial", "options": {"port": "/dev/null"}}}, False),
        ({"driver": {"name": "serial", "options": {"port": "/dev/null"}}, "output_resolution_v": 1e-3}, True),
    ],
)
def test_rounding_is_fed_back_where_it_bounds_the_force_and_the_bits_are_known(changes, shaped):
    plant = tuned_once("magnet-beam").plant
    large = OutputBits(plain_n=0.02, shaped_n=0.001)
    found = lowest_force(bench_with(changes), plant, 1e-3, large)
    assert found.noise_shaping == shaped
    assert not lowest_force(bench_with(changes), plant, 1e-3, OutputBits(0.0, 0.0)).noise_shaping
