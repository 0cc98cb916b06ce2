"""Modal properties from single points of stepped sines, against the rigs' own backbones by harmonic balance."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from identification import FrequencyResponse, IdentificationError, NonlinearMode, single_point_mode
from simulators import VirtualRig
from simulators.analysis import PeriodicResponses, constant_force_response, phase_resonance_backbone
from tests.identification.nonlinear.test_stepped_sine import MASS_KG, level
from tests.refused import refused


def measured(found: PeriodicResponses) -> FrequencyResponse:
    return FrequencyResponse(
        found.frequency_hz, found.force_harmonics_n[:, 1], found.drive_harmonics_m[:, 1], "displacement", "force", 1.0
    )


def deviations(mode: NonlinearMode, backbone: PeriodicResponses) -> tuple[np.ndarray, np.ndarray]:
    """Relative deviations of frequency and damping from the backbone at the same amplitudes."""
    curves = (
        PchipInterpolator(backbone.amplitude_m, y, extrapolate=False)(mode.amplitude_m)
        for y in (backbone.modal_frequency_hz, backbone.damping_ratio)
    )
    frequency, damping = curves
    return mode.modal_frequency_hz / frequency - 1.0, mode.damping_ratio / damping - 1.0


def test_one_linear_mode_is_returned_at_every_point() -> None:
    mode = single_point_mode([level()], 1 / np.sqrt(MASS_KG), phase_window_deg=80.0)
    np.testing.assert_allclose(mode.modal_frequency_hz, 80.3, rtol=1e-10)
    np.testing.assert_allclose(mode.damping_ratio, 0.004, rtol=1e-8)
    assert np.all(np.diff(mode.amplitude_m) >= 0.0)
    assert mode.source == "stepped sine"


@pytest.mark.parametrize("specimen", ["magnet-beam", "magnet-beam-symmetric"])
def test_force_controlled_points_of_the_magnet_beams_lie_on_their_backbone(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen)
    curve = constant_force_response(rig, 0.3, np.arange(-150.0, -29.0, 15.0), harmonics=9)
    backbone = phase_resonance_backbone(rig, forces_n=np.geomspace(0.1, 0.32, 12), harmonics=9)
    mode = single_point_mode([measured(curve)], float(rig.linear_modes.drive_shape[0]), phase_window_deg=62.0)
    frequency, damping = deviations(mode, backbone)
    assert np.isfinite(frequency).sum() >= 8
    assert np.nanmax(np.abs(frequency)) < 6e-5
    assert np.nanmax(np.abs(damping)) < 5e-3
    assert any("more than 30 deg" in note for note in mode.notes)


def test_on_the_friction_beam_both_sides_of_resonance_cancel_the_other_modes() -> None:
    rig = VirtualRig.shipped("friction-beam")
    curve = constant_force_response(rig, 8.0, [-115.0, -110.0, -90.0, -70.0, -65.0], harmonics=7)
    backbone = phase_resonance_backbone(rig, forces_n=np.geomspace(5.0, 9.0, 9), harmonics=7)
    mode = single_point_mode([measured(curve)], rig.drive_shape(149.0))
    frequency, damping = deviations(mode, backbone)
    assert np.max(np.abs(frequency)) < 3e-4
    assert 0.015 < np.max(np.abs(damping)) < 0.05
    assert abs(np.mean(damping)) < 0.01


def test_points_far_from_resonance_are_left_out_and_none_at_all_is_refused() -> None:
    mode = single_point_mode([level()], 1.0)
    assert "points left out" in mode.notes[1]
    with refused(IdentificationError, "none-of-points-lies-within-deg", field="responses"):
        single_point_mode([level(f_hz=np.linspace(60.0, 61.0, 10))], 1.0)
    with refused(IdentificationError, field="phase_window_deg", value=90, allowed="above 0 to 80"):
        single_point_mode([level()], 1.0, phase_window_deg=90)
    with refused(IdentificationError, field="drive_mode_shape", value=0.0):
        single_point_mode([level()], 0.0)
    with refused(IdentificationError, "none-given", field="responses"):
        single_point_mode([], 1.0)
