"""Which weights a fit of responses begins with, by what is known of their errors."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from identification import Channel, FrequencyResponseMatrix, IdentificationError, linear_modes
from identification.linear.accelerance import (
    _lines_alike,
    first_weighting,
    pooled,
    relative_weights,
    weighted_accelerance,
    weighted_responses,
)
from tests.identification.linear.structures import FREQUENCY_HZ, measured
from tests.refused import refused

TOTAL = measured(1, 0.1)
NOISE = replace(TOTAL, total_covariance=None, noise_covariance=TOTAL.total_covariance)


@pytest.mark.parametrize("weighting", ["auto", "total", "noise", "relative"])
def test_a_fit_begins_with_the_weights_it_was_asked_for_unless_only_the_fit_can_provide_them(weighting):
    assert first_weighting(TOTAL, weighting) == weighting
    assert first_weighting(NOISE, weighting) == ("auto" if weighting == "total" else weighting)


def test_relative_weights_are_used_although_the_noise_is_known():
    found = weighted_responses(NOISE, first_weighting(NOISE, "relative"))
    assert (found.kind, found.covariance) == ("relative", None)
    size = np.abs(NOISE.value[:, :, 0])
    np.testing.assert_allclose(found.std[:, :, 0], np.maximum(size, 1e-3 * size.max(axis=0)), rtol=1e-12)
    notes = linear_modes(NOISE, modes=list(FREQUENCY_HZ), weighting="relative", orders=range(2, 15, 2)).notes
    assert any("no covariance" in note for note in notes)


def covariances(lines, count, samples, seed=1):
    """complex[lines, count, count]: sample covariances of so many complex samples, larger from line to line."""
    random = np.random.default_rng(seed)
    parts = random.normal(size=(2, lines, count, samples)) * (1.0 + np.arange(lines))[None, :, None, None]
    values = parts[0] + 1j * parts[1]
    return values @ np.conj(np.swapaxes(values, 1, 2)) / samples


@pytest.mark.parametrize(
    ("lines", "count", "samples", "alike", "reach"),
    [
        (30, 2, 8, 1, 4),
        (30, 2, 8, 2, 8),  # neighbours with the same errors count once
        (30, 4, 1, 1, 8),  # one direction a line: 16 lines for four samples in each of four
        (30, 3, 1, 1, 6),
        (6, 2, 8, 1, 4),
        (4, 2, 8, 1, 3),
        (3, 1, 2, 5, 2),
        (2, 2, 8, 1, 1),
    ],
)
def test_a_weight_is_the_mean_covariance_of_so_many_neighbours_without_the_line_itself(
    lines, count, samples, alike, reach
):
    own = covariances(lines, count, samples)
    found = pooled(own, alike)
    for line in range(lines):
        near = [other for other in range(line - reach, line + reach + 1) if 0 <= other < lines and other != line]
        mean = sum(own[other] for other in near) / len(near)
        np.testing.assert_allclose(found[line], mean + 1e-9 * np.diag(np.diag(mean)), rtol=1e-9, atol=1e-12 * lines**2)


def test_the_only_line_has_its_own_covariance():
    (own,) = covariances(1, 2, 8)
    np.testing.assert_allclose(pooled(own[None])[0], own + 1e-9 * np.diag(np.diag(own)), rtol=1e-12)


@pytest.mark.parametrize(("lines", "alike"), [(200, 101), (51, 101), (50, 99), (10, 19), (1, 1)])
def test_lines_with_the_same_errors_count_as_one_up_to_fifty_on_either_side(lines, alike):
    assert _lines_alike(np.ones((lines, 3, 2), complex)) == alike


def test_lines_count_as_alike_by_the_squares_of_their_correlations():
    """Errors whose correlation is 0.8 to the distance of the lines: ``1 + 2 sum 0.64^k`` over those from 0.05 on, 4.4."""
    random = np.random.default_rng(4)
    noise = random.normal(size=(2, 4000, 20, 1))
    errors = scipy.signal.lfilter([1.0], [1.0, -0.8], noise[0] + 1j * noise[1], axis=0)
    assert _lines_alike(errors) == 4
    assert _lines_alike(noise[0] + 1j * noise[1]) == 1
    assert _lines_alike(None) == 1


def test_relative_weights_are_squared_sizes_but_none_far_below_the_largest():
    found = relative_weights(weighted_responses(RESONANT))
    np.testing.assert_allclose(found.std[:, :, 0], [[4.0, 0.5], [0.004, 0.1], [1.0, 0.3]], rtol=1e-12)


RESONANT = FrequencyResponseMatrix(
    frequency_hz=np.array([1.0, 2.0, 3.0]),
    value=np.array([[4.0, 0.5j], [1e-5, -0.1], [1j, 0.3]])[:, :, None],
    inputs=(Channel("force", "force", "N"),),
    outputs=(Channel("drive", "drive", "m/s"), Channel("tip", "response", "m")),
)


def test_motions_and_the_errors_of_each_become_accelerations():
    covariance = np.array([[2.0, 0.5 + 0.1j], [0.5 - 0.1j, 3.0]])
    responses = replace(RESONANT, noise_covariance=np.tile(covariance, (3, 1, 1)))
    found = weighted_accelerance(responses)
    for line, frequency_hz in enumerate((1.0, 2.0, 3.0)):
        s = 2j * np.pi * frequency_hz
        turn = np.diag([s, s**2])  # of a velocity and of a displacement
        np.testing.assert_allclose(found.value[line, :, 0], turn @ responses.value[line, :, 0], rtol=1e-12)
        np.testing.assert_allclose(found.covariance[line], turn @ covariance @ np.conj(turn), rtol=1e-12)
        np.testing.assert_allclose(
            found.smooth[line], found.covariance[line], rtol=1e-8
        )  # its neighbours have the same


def test_what_is_no_weighting_or_has_no_covariance_is_refused():
    with refused(IdentificationError, field="weighting", value="all", allowed="auto, total, noise, relative"):
        weighted_responses(RESONANT, "all")
    with refused(IdentificationError, "the-responses-have-no-noise-covariance", field="weighting", value="noise"):
        weighted_responses(RESONANT, "noise")
    with refused(IdentificationError, "begins-at-hz", field="frequency_hz"):
        weighted_accelerance(replace(RESONANT, frequency_hz=np.array([0.0, 1.0, 2.0])))
