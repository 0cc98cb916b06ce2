"""The shipped stepped sines and sweeps at held force, a level and a few frequencies of each, against harmonic balance."""

import numpy as np
import pytest

import rig
from rig.campaigns.plans import load_plan
from simulators import VirtualRig
from simulators.analysis import constant_force_response

STEPPED = {
    # plan: level (N), frequencies on one branch (Hz), largest errors of frequency and amplitude
    "magnet-beam/stepped-sine-up": (0.55, [24.6, 24.9], 1e-4, 0.01),
    "magnet-beam/stepped-sine-down": (0.55, [25.5, 25.3], 5e-4, 0.01),
    "friction-beam/stepped-sine-up": (5.0, [146.2, 146.8], 3e-4, 0.02),
    "friction-beam/stepped-sine-down": (15.0, [146.6, 145.4], 3e-4, 0.02),
}
SWEEPS = {
    # plan: level (N), from, to (Hz), least and largest force over the level
    "magnet-beam/controlled-sweep-up": (0.55, 24.6, 25.4, 0.85, 3.5),
    "magnet-beam/controlled-sweep-down": (0.55, 25.5, 24.9, 0.85, 1.05),
    "friction-beam/controlled-sweep-up": (5.0, 146.0, 148.0, 0.965, 1.035),
    "friction-beam/controlled-sweep-down": (15.0, 147.0, 145.0, 0.965, 1.035),
}


@pytest.mark.parametrize("name", STEPPED)
def test_a_stepped_sine_at_held_force_lies_on_the_curve_of_harmonic_balance(name):
    level, frequencies, frequency_error, amplitude_error = STEPPED[name]
    points = {"levels_n": (level,), "frequencies_hz": tuple(frequencies), "start_hz": None, "stop_hz": None}
    with rig.run(load_plan(name).model_copy(update=points), seed=3) as run:
        assert run.complete, [point["reason"] for point in run.recording.points]
        (response,) = run.frequency_responses()
    order = np.argsort(response.phase_lag_deg)
    truth = constant_force_response(
        VirtualRig.shipped(name.split("/")[0]), level, list(response.phase_lag_deg[order] - 180.0)
    )
    np.testing.assert_allclose(response.force_n, level, rtol=0.01)
    np.testing.assert_allclose(response.frequency_hz[order], truth.frequency_hz, rtol=frequency_error)
    np.testing.assert_allclose(response.amplitude_m[order], truth.amplitude_m, rtol=amplitude_error)


@pytest.mark.parametrize("name", SWEEPS)
def test_a_sweep_at_held_force_holds_it_but_where_it_jumps(name):
    level, first, last, least, most = SWEEPS[name]
    part = {"levels_n": (level,), "start_hz": first, "stop_hz": last}
    with rig.run(load_plan(name).model_copy(update=part), seed=3) as run:
        (point,) = run.recording.latest.values()
    truth = constant_force_response(VirtualRig.shipped(name.split("/")[0]), level, list(np.linspace(-150.0, -30.0, 25)))
    assert least < point["held_least"] <= point["held_most"] < most
    if truth.stable.all():
        assert point["peak_m"] == pytest.approx(truth.amplitude_m.max(), rel=0.01)
    elif first < last:  # it stays on the upper branch until that ends
        assert 0.0 < point["peak_frequency_hz"] - truth.frequency_hz.max() < 0.1
    else:  # it never comes to the upper branch's height
        assert point["peak_m"] < 0.95 * truth.amplitude_m.max()
