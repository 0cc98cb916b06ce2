"""Steady peaks that structured models of the virtual magnet beam predict, against those of the rig itself."""

import numpy as np
import pytest

import identification
import rig
from identification.models import Masing, PolynomialSpring
from rig.analysis.subject import subject_of
from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from simulators.analysis import constant_force_response, phase_resonance_backbone
from tests.recorded import recorded_run

pytestmark = pytest.mark.slow

FORCES_N = (0.25, 0.55)
BAND = {"band_hz": (22.0, 27.0), "largest_range_use": 3.0}


@pytest.fixture(scope="module")
def model():
    """Two realisations at 2.6 and at 5.2 N RMS; the modes are those at 0.5 N."""
    found = []
    for number in (1, 2, 3):
        plan = load_plan(f"magnet-beam/multisine-{number}").model_copy(update={"realisations": 2})
        with rig.run(plan, seed=number) as run:
            found.append(run.experiments())
            if number == 1:
                modes = identification.linear_modes(next(iter(run.response_matrices().values())), modes=1)
    laws = (PolynomialSpring(), Masing.spaced(8))
    return identification.fit_structured(modes, [*found[1], *found[2]], laws=laws).model


@pytest.fixture(scope="module")
def exciter():
    with recorded_run("magnet-beam/exciter", seed=3) as run:
        measured = next(iter(run.spectra().values()))
    return identification.identify_exciter(measured, sample_rate_hz=5000.0)


@pytest.fixture(scope="module")
def truth():
    return subject_of(load_bench("magnet-beam")).rig


@pytest.mark.parametrize("force_n", FORCES_N)
def test_the_peak_under_a_pure_sine_is_that_of_the_structure(model, truth, force_n):
    exact = phase_resonance_backbone(truth, forces_n=np.linspace(0.1, 1.0, 10) * force_n, excitation="pure-sine")
    found = identification.frequency_response(model, force_n, **BAND)
    assert found.complete
    assert found.peak().amplitude_m == pytest.approx(exact.amplitude_m[-1], rel=0.02)
    assert found.peak().frequency_hz == pytest.approx(exact.frequency_hz[-1], rel=3e-3)
    backbone = identification.backbone(model, force_n, largest_range_use=3.0)
    assert np.abs(backbone.displacement_m[-1, 1, 0]) == pytest.approx(exact.amplitude_m[-1], rel=0.02)


@pytest.mark.parametrize("force_n", FORCES_N)
def test_with_the_identified_exciter_the_peak_is_that_of_the_rig(model, exciter, truth, force_n):
    exact = constant_force_response(truth, force_n, np.linspace(-150.0, -30.0, 41))
    found = identification.frequency_response(model, force_n, force="fundamental", exciter=exciter, **BAND)
    assert found.complete
    assert found.peak().amplitude_m == pytest.approx(np.max(exact.amplitude_m), rel=0.02)
    assert found.peak().frequency_hz == pytest.approx(exact.frequency_hz[np.argmax(exact.amplitude_m)], rel=2e-3)
