"""What the rig does where its models are asked: within the band, and at voltages that belong to the forces."""

import numpy as np
import pytest

from rig.bench import load_bench
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from studies.reproduce.options import Options
from studies.reproduce.specimens import SPECIMENS
from studies.reproduce.true_responses import truths


@pytest.mark.parametrize("name", list(SPECIMENS))
def test_resonances_at_all_forces_are_well_within_the_band_that_is_followed(name):
    specimen = SPECIMENS[name]
    rig = VirtualRig.shipped(name)
    low, high = specimen.band_hz
    for excitation in ("exciter", "pure-sine"):
        there = phase_resonance_backbone(rig, forces_n=specimen.forces_n, excitation=excitation).frequency_hz
        assert np.all(there > 1.03 * low)
        assert np.all(there < 0.97 * high)


def test_voltages_are_those_at_which_the_rig_has_the_forces_at_resonance(tmp_path):
    options = Options(
        specimen=SPECIMENS["magnet-beam"], bench=load_bench("magnet-beam"), folder=tmp_path, input="voltage"
    )
    known = truths(options)
    assert [(one.held, one.force_n) for one in known] == [
        (held, force_n) for force_n in (0.25, 0.55) for held in ("voltage", "fundamental")
    ]
    rig = VirtualRig.shipped("magnet-beam")
    for voltage, force in zip(known[::2], known[1::2], strict=True):
        there = phase_resonance_backbone(rig, voltages_v=[voltage.level])
        assert there.force_n[0] == pytest.approx(voltage.force_n, rel=0.01)
        assert there.amplitude_m[0] == pytest.approx(force.amplitude_m, rel=0.005)
        # The exciter's coil damps what a voltage drives: the resonance is broad, and elsewhere than that of the force.
        assert voltage.amplitude_m > there.amplitude_m[0]
        assert voltage.frequency_hz > force.frequency_hz + 0.3
        assert force.text == f"{force.force_n:g} N"
        assert voltage.text.endswith(" V")
