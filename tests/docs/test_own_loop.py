"""The controller in a loop of one's own, from its page alone, against the time integration of the same oscillator by scipy."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.docs.pages import ROOT, blocks

PAGE = ROOT / "docs" / "how-to" / "use-the-controller-in-my-own-loop.md"
M, C, K, K3 = 1.0, 2.5, 15800.0, 1e9  # of the page
REPORT = """
import json, sys
others = sorted({name.split(".")[0] for name in sys.modules} & {"rig", "simulators", "identification", "h5py"})
print(json.dumps([others, backbone]))
"""


@pytest.fixture(scope="module")
def found():
    """Packages that the page's loop has imported beside the controller, and its backbone: displacement, frequency, force."""
    (page,) = (block for block in blocks(PAGE) if block.language == "python")
    done = subprocess.run(
        [sys.executable, "-c", page.text + REPORT], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_controller_alone_is_imported(found):
    assert found[0] == []


def test_every_point_is_at_phase_resonance_of_the_oscillator_under_that_force(found):
    assert len(found[1]) == 4
    for displacement_m, omega, force_n in found[1][1:]:
        period_s = 2.0 * math.pi / omega

        def motion(t, y, omega=omega, force_n=force_n):
            return y[1], (force_n * math.cos(omega * t) - C * y[1] - K * y[0] - K3 * y[0] ** 3) / M

        # from the resonance's own state, so that little is left to die away: x = X sin(omega t)
        times = period_s * (120 + np.arange(64) / 64.0)
        start = (0.0, displacement_m * omega)
        x = solve_ivp(motion, (0.0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-14).y[0]
        fundamental = 2.0 * np.mean(x * np.exp(-1j * omega * times))
        assert abs(fundamental) == pytest.approx(displacement_m, rel=2e-3)
        assert np.degrees(np.angle(fundamental)) == pytest.approx(-90.0, abs=0.5)


def test_the_amplitudes_are_the_wanted_ones(found):
    np.testing.assert_allclose([point[0] for point in found[1][1:]], [2e-4, 5e-4, 1e-3], rtol=1e-3)
