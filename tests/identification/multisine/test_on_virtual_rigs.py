"""Multisines on the virtual rigs against the rigs' own frequency response."""

import numpy as np
import pytest

import rig
from identification import best_linear_approximation, distortion_levels
from rig.campaigns.multisine.plan import MultisinePlan
from rig.errors import ConfigurationError
from simulators import VirtualRig
from simulators.analysis import frequency_response
from tests.refused import refused

PLAN = MultisinePlan(
    bench="magnet-beam",
    levels_rms_v=(0.1, 2.0),
    lowest_hz=15.0,
    highest_hz=35.0,
    resolution_hz=0.2,
    grid="odd-random",
    realisations=4,
    periods=3,
    transient_periods=4,
)


@pytest.fixture(scope="module")
def spectra():
    with rig.run(PLAN, seed=2) as run:
        assert run.complete
        yield run.spectra()


def test_a_plan_too_narrow_for_detection_lines_is_refused_with_the_size_of_its_groups():
    narrow = PLAN.model_copy(update={"highest_hz": 16.0})
    with refused(ConfigurationError, "no-line-of-the-odd-random", field="lowest_hz, highest_hz"):
        rig.run(narrow)


@pytest.mark.slow
def test_a_low_level_gives_the_linear_response_of_the_rig_with_its_held_output(spectra):
    beam = VirtualRig.shipped("magnet-beam")
    found = best_linear_approximation(spectra[0.1])
    truth = frequency_response(beam, found.frequency_hz, held=True)
    for output, channel in enumerate(found.outputs):
        expected = truth.sensor_per_v[channel.name] / truth.force_n_per_v
        error = np.abs(found.value[:, output, 0] / expected - 1.0)
        assert np.median(error) < 3e-3
        assert np.max(error) < 0.03  # at resonance, where a small force is all that is left
    assert found.input_rms[0] == pytest.approx(0.268, rel=0.02)


def test_odd_distortion_of_the_magnet_beam_grows_with_level_and_even_is_small(spectra):
    low, high = distortion_levels(spectra[0.1]), distortion_levels(spectra[2.0])
    assert high.ratio("drive", "odd") > 20.0 * low.ratio("drive", "odd")
    assert high.ratio("drive", "odd") > 5.0 * high.ratio("drive", "even")
    assert high.ratio("drive", "excited") == pytest.approx(high.ratio("drive", "odd"), rel=0.6)
    # Referred to the force the structure distorts far more than the rig: the shaker holds it back.
    structure = distortion_levels(spectra[2.0], input="force")
    assert structure.ratio("drive", "odd") > 2.0 * high.ratio("drive", "odd")
