"""The unwrapped phase against the one that was wrapped."""

import numpy as np
import pytest

from identification.signals.chunks import unwrapped


@pytest.mark.parametrize("step_rad", [0.03, 1.0, 3.1, -0.7])
@pytest.mark.parametrize("single", [True, False])
def test_a_wrapped_phase_is_found_again(step_rad, single):
    phase = 0.4 + step_rad * np.arange(20_000.0)
    wrapped = np.remainder(phase, 2.0 * np.pi)
    if single:
        wrapped = wrapped.astype(np.float32).astype(float)
    found = unwrapped(wrapped)
    assert found == pytest.approx(phase, abs=1e-6 if single else 1e-10)
    assert found == pytest.approx(np.unwrap(wrapped), abs=1e-7)  # which sums the turns one by one


def test_the_phase_that_is_given_stays_as_it_is():
    wrapped = np.array([6.0, 0.1, 0.5])
    unwrapped(wrapped)
    assert wrapped.tolist() == [6.0, 0.1, 0.5]
    assert unwrapped(wrapped[:1]).tolist() == [6.0]
