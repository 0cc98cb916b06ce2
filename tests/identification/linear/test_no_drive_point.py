"""Modal analysis of responses among which that at the drive point is missing."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix, IdentificationError, LinearModes, linear_modes
from identification.common import decode, encode
from identification.linear.extrapolation import extrapolated_to_zero
from identification.linear.modes import mac_matrix
from tests.identification.linear.structures import DAMPING, FREQUENCY_HZ, LINES_HZ, SHAPES, accelerance, measured
from tests.refused import refused

ELSEWHERE = np.array([[1.3, -0.4, 0.5], [0.2, 0.6, -1.1]])
OUTPUTS = (Channel("tip", "response", "m/s2"), Channel("middle", "response", "m/s2"))


def elsewhere(noise: float = 0.0, seed: int = 0) -> FrequencyResponseMatrix:
    """The responses at two other points to the force at the drive point of `structures`."""
    exact = np.stack([accelerance(shapes=np.array([SHAPES[0], shape]))[:, 1] for shape in ELSEWHERE], axis=1)
    return replace(measured(seed, noise, exact), outputs=OUTPUTS)


@pytest.mark.parametrize("complex_residues", [False, True])
def test_frequencies_and_damping_are_those_of_the_structure_and_shapes_are_proportional_to_its_own(complex_residues):
    modes = linear_modes(elsewhere(), modes=3, complex_residues=complex_residues)
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ, rtol=2e-5)
    np.testing.assert_allclose(modes.damping_ratio, DAMPING, rtol=2e-3)
    largest = np.argmax(np.abs(ELSEWHERE), axis=0)
    np.testing.assert_allclose(modes.shapes, ELSEWHERE / ELSEWHERE[largest, range(3)], rtol=5e-3, atol=1e-3)
    np.testing.assert_allclose(modes.accelerance(LINES_HZ), elsewhere().value[:, :, 0], rtol=5e-3, atol=5e-3)
    assert not modes.normalised
    assert [row["drive_shape"] for row in modes.table()] == [None] * 3
    assert any("not mass-normalised" in note for note in modes.notes)


def test_errors_hold_the_truth_and_those_of_the_largest_shape_are_zero():
    modes = linear_modes(elsewhere(0.1, 1), modes=list(FREQUENCY_HZ))
    largest = np.argmax(np.abs(ELSEWHERE), axis=0)
    truth = ELSEWHERE / ELSEWHERE[largest, range(3)]
    assert np.all(np.abs(modes.frequency_hz - FREQUENCY_HZ) < 4 * modes.frequency_std_hz)
    assert np.all(np.abs(modes.shapes - truth) <= 4 * modes.shapes_std)
    np.testing.assert_allclose(modes.shapes_std[largest, range(3)], 0.0, atol=1e-12)
    assert np.all(modes.shapes_std[1 - largest, range(3)] > 0.0)


def test_a_drive_point_gives_the_same_frequencies_and_is_what_normalises():
    both = linear_modes(measured(1, 0.1), modes=3)
    alone = linear_modes(measured(1, 0.1).select(["tip"]), modes=3)
    np.testing.assert_allclose(alone.frequency_hz, both.frequency_hz, rtol=1e-4)
    assert both.normalised
    assert both.residues is None


def test_what_needs_the_drive_point_says_so():
    modes = linear_modes(elsewhere(), modes=3)
    for asked in (
        lambda: modes.drive_row,
        lambda: modes.drive_shape,
        lambda: modes.mode_shapes(),
        lambda: modes.receptance(FREQUENCY_HZ),
    ):
        with refused(IdentificationError, "no-drive-point-not-mass-normalised", field="modes"):
            asked()
    np.testing.assert_allclose(
        modes.receptance(30.0, "tip"), elsewhere().path("tip")[400] / (2j * np.pi * 30.0) ** 2, rtol=2e-3
    )


def test_modes_without_drive_point_are_stored_and_extrapolated_and_have_a_mac():
    modes = linear_modes(elsewhere(0.05, 2), modes=3)
    back = decode(LinearModes, *encode(modes))
    np.testing.assert_array_equal(back.residues, modes.residues)
    assert not back.normalised
    np.testing.assert_allclose(np.diag(mac_matrix(modes, modes)), 1.0)
    both = extrapolated_to_zero(modes, replace(modes, force_rms_n=2.0))
    np.testing.assert_allclose(both.shapes, modes.shapes, rtol=1e-9)


def test_modes_without_drive_point_need_residues_and_two_drive_points_are_refused():
    modes = linear_modes(elsewhere(), modes=3)
    with refused(IdentificationError, field="channels"):
        replace(modes, residues=None)
    with refused(IdentificationError, "drive", field="channels"):
        linear_modes(replace(elsewhere(), outputs=tuple(Channel(c.name, "drive", c.unit) for c in OUTPUTS)))
