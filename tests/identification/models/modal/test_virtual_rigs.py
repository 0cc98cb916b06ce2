"""Shipped backbone recordings predict the rigs' own responses to a constant force, as harmonic balance has them."""

from functools import cache

import numpy as np
import pytest

from identification import Comparison, FrequencyResponse, NonlinearMode, compare, frequency_response, nonlinear_mode
from simulators import VirtualRig
from simulators.analysis import constant_force_response
from tests.recorded import recorded_run

LEVELS = [
    ("magnet-beam", 0.25),
    ("magnet-beam", 0.55),
    ("friction-beam", 2.0),
    ("friction-beam", 5.0),
    ("friction-beam", 15.0),
]
PEAK = {"magnet-beam": 0.003, "friction-beam": 0.01}
PEAK_FREQUENCY = {"magnet-beam": 1e-4, "friction-beam": 1e-3}
ENVELOPE = {"magnet-beam": 0.003, "friction-beam": 0.03}


@cache
def identified(name: str) -> NonlinearMode:
    with recorded_run(f"{name}/backbone") as run:
        return nonlinear_mode(run.backbone())


@cache
def truth(name: str, force_n: float) -> tuple[FrequencyResponse, np.ndarray]:
    found = constant_force_response(VirtualRig.shipped(name), force_n)
    assert found.stable is not None
    response = FrequencyResponse(
        found.frequency_hz,
        found.force_harmonics_n[:, 1],
        found.drive_harmonics_m[:, 1],
        "displacement",
        "force",
        force_n,
    )
    return response, found.stable


@cache
def compared(name: str, force_n: float) -> Comparison:
    reference, _ = truth(name, force_n)
    return compare(frequency_response(identified(name), force_n), reference, over="phase", phase_window_deg=60.0)


@pytest.mark.parametrize(("name", "force_n"), LEVELS)
def test_peaks_are_those_of_the_rig(name: str, force_n: float) -> None:
    error = compared(name, force_n).error
    assert abs(error.peak_error) < PEAK[name]
    assert abs(error.peak_frequency_error) < PEAK_FREQUENCY[name]
    assert error.envelope_error < ENVELOPE[name]
    assert error.range_use < 1.0


@pytest.mark.parametrize("force_n", [0.25, 0.55])
def test_the_unstable_branch_and_its_folds_are_those_of_the_rig(force_n: float) -> None:
    reference, stable = truth("magnet-beam", force_n)
    found = frequency_response(identified("magnet-beam"), force_n)
    lag = reference.phase_lag_deg[~stable]
    assert lag.size >= 10
    amplitude = np.interp(lag, found.phase_lag_deg(), found.amplitude_m())
    np.testing.assert_allclose(amplitude, reference.amplitude_m[~stable], rtol=5e-3)
    frequency = np.interp(lag, found.phase_lag_deg(), found.frequency_hz)
    np.testing.assert_allclose(frequency, reference.frequency_hz[~stable], rtol=2e-4)
    ends = reference.frequency_hz[~stable][[0, -1]]
    np.testing.assert_allclose(found.fold_frequency_hz, ends, rtol=2e-4)
    agreed = np.interp(reference.phase_lag_deg, found.phase_lag_deg(), found.stable.astype(float)) > 0.5
    near = np.abs(reference.phase_lag_deg - 90.0) < 60.0
    assert np.count_nonzero((agreed != stable)[near]) <= 2
