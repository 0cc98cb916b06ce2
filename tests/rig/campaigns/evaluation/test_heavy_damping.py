"""Other modes shift the phase resonance of a heavily damped one, and a point says so."""

import numpy as np
import pytest
from scipy.optimize import brentq

from rig.campaigns.evaluation.heavy_damping import with_heavy_damping
from rig.campaigns.evaluation.point import Lock
from tests.rig.campaigns.made_points import made_modal, made_point


def point_with(damping_ratio, **fields):
    return made_point(modal=made_modal(24.0, damping_ratio), **{"lock": Lock(phase_error_deg=0.0), **fields})


@pytest.mark.parametrize("damping_ratio", [0.15, 0.2, 0.5])
def test_a_heavily_damped_point_is_warned_with_the_shift_of_the_receptance_of_two_modes(damping_ratio):
    share = 1e-3  # of the static compliance: a stiff mode far above

    def real_part(x):
        return (1.0 / (1.0 - x**2 + 2j * damping_ratio * x) + share).real

    shift = brentq(real_part, 1.0, 1.1) - 1.0
    (warning,) = with_heavy_damping(point_with(damping_ratio)).warnings
    stated = float(warning.split("resonance by ")[1].split(" %")[0]) / 100.0
    assert shift / share == pytest.approx(stated, rel=0.05)
    assert warning.startswith(f"damping ratio {100.0 * damping_ratio:g} % (warning above 10 %): other modes shift")


def test_points_that_are_lightly_damped_or_held_no_phase_are_left_as_they_are():
    for point in (point_with(0.02), point_with(np.nan), point_with(None), point_with(0.3, lock=None), made_point()):
        assert with_heavy_damping(point) is point
