"""Which weights a fit of responses begins with, by what is known of their errors."""

from dataclasses import replace

import numpy as np
import pytest

from identification import linear_modes
from identification.linear.accelerance import first_weighting, weighted_responses
from tests.identification.linear.structures import FREQUENCY_HZ, measured

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
    assert any("no covariance of the responses is known" in note for note in notes)
