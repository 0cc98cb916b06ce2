"""Rounding in the converters, as a force away from the frequency of the output."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from rig.campaigns.evaluation.acceptance import nonharmonic_objection
from rig.tuning.converter_bits import bits_force_n, periodic_beyond, rounding
from tests.rig.rigs import bench_with

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
    assert bits_force_n(bench, flat, 0.0) == pytest.approx(inside, rel=1e-3)
    whole = 4.0 * bench.output_bit_v / math.sqrt(12.0)
    assert bits_force_n(bench, flat, math.inf) == pytest.approx(whole, rel=1e-3)


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
