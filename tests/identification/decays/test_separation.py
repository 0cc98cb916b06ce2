"""What of a neighbour passes the filter of a mode, by the ranges of their frequencies."""

import numpy as np
import pytest

from identification.decays.separation import _through

LOW, HIGH = np.array([10.0, 20.0]), np.array([30.0, 32.0])
PERIODS = 4
"""All edges of the ranges in the first test are a multiple of a quarter apart, at which the filter lets nothing pass."""


@pytest.mark.parametrize("theirs", [[15.0, 40.0], [5.0, 15.0], [12.5, 15.0], [5.0, 40.0], [20.0, 40.0], [5.0, 10.0]])
def test_ranges_that_share_a_frequency_are_never_told_apart(theirs):
    assert _through(np.array(theirs), LOW, PERIODS) == 1.0
    assert _through(LOW, np.array(theirs), PERIODS) == 1.0


@pytest.mark.parametrize("periods", [1, 3, 7])
def test_of_ranges_apart_passes_what_the_cubic_window_lets_pass(periods):
    for one, other in ((LOW, HIGH), (HIGH, LOW)):
        distances = np.array([a / b - 1.0 for a in one for b in other])
        shares = (np.sin(np.pi * periods * distances) / (np.pi * periods * distances)) ** 4
        assert _through(one, other, periods) == pytest.approx(np.max(shares), rel=1e-9)
