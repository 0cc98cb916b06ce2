from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Channel,
    FrequencyResponseMatrix,
    IdentificationError,
    LinearModes,
    linear_modes,
    stabilisation,
)
from identification.storage import decode, encode
from tests.identification.linear.structures import (
    CHANNELS,
    DAMPING,
    FORCE,
    FREQUENCY_HZ,
    LINES_HZ,
    SHAPES,
    accelerance,
    measured,
)
from tests.refused import refused


def test_modes_are_found_and_mass_normalised_without_being_asked_for() -> None:
    modes = linear_modes(measured(1, 0.1))
    assert np.all(np.abs(modes.frequency_hz - FREQUENCY_HZ) < 4 * modes.frequency_std_hz)
    assert np.all(np.abs(modes.damping_ratio - DAMPING) < 4 * modes.damping_ratio_std)
    assert np.all(np.abs(modes.shapes - SHAPES) < 4 * modes.shapes_std)
    assert modes.fit_residual == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(modes.accelerance(LINES_HZ), accelerance(), atol=0.05 * np.max(np.abs(accelerance())))


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    truth = np.concatenate([FREQUENCY_HZ, DAMPING, SHAPES.ravel()])
    inside = []
    for seed in range(15):
        modes = linear_modes(measured(seed, 0.5), modes=list(FREQUENCY_HZ), orders=range(2, 15, 2))
        found = np.concatenate([modes.frequency_hz, modes.damping_ratio, modes.shapes.ravel()])
        assert modes.covariance is not None
        inside.append(np.abs(found - truth) < 1.96 * np.sqrt(np.diag(modes.covariance)))
    assert 0.9 <= np.mean(inside) <= 0.99


def test_velocities_and_displacements_give_the_same_modes_as_accelerations() -> None:
    s = 2j * np.pi * LINES_HZ
    channels = (Channel("drive", "drive", "m"), Channel("tip", "response", "m/s"))
    value = measured(2, 0.05).value / np.stack([s**2, s], axis=1)[:, :, None]
    responses = FrequencyResponseMatrix(outputs=channels, inputs=FORCE, frequency_hz=LINES_HZ, value=value)
    modes = linear_modes(responses, modes=3)
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ, rtol=1e-3)
    np.testing.assert_allclose(modes.shapes, SHAPES, rtol=0.05)
    assert any("no covariance" in note for note in modes.notes)


def test_a_number_of_modes_or_frequencies_near_them_can_be_asked_for() -> None:
    responses = measured(3, 0.5)
    assert linear_modes(responses, modes=3).frequency_hz.size == 3
    near = linear_modes(responses, modes=[60.5, 19.8, 33.2])
    np.testing.assert_allclose(near.frequency_hz, FREQUENCY_HZ, rtol=1e-3)
    with refused(IdentificationError, "wanted-found", field="modes"):
        linear_modes(responses, modes=9)
    with refused(IdentificationError, "frequencies-are-hz", field="modes", allowed="10 to 79.95 Hz"):
        linear_modes(responses, modes=[20.0, 90.0])


def test_complex_residues_are_recovered_and_their_collinearity_told() -> None:
    s = 2j * np.pi * LINES_HZ[:, None]
    omega = 2 * np.pi * FREQUENCY_HZ
    pole = omega * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    residues = SHAPES * SHAPES[0] * np.exp(1j * np.array([[0.05, -0.05, 0.1], [0.6, 0.5, -0.7]]))
    part = residues / (2j * pole.imag)
    modal = s**2 / (s - pole) @ part.T + s**2 / (s - np.conj(pole)) @ np.conj(part).T
    modes = linear_modes(measured(4, 0.05, exact=modal + 0.3), complex_residues=True)
    assert modes.residues is not None
    np.testing.assert_allclose(modes.residues, residues, atol=0.02)
    np.testing.assert_allclose(modes.accelerance(LINES_HZ), modal + 0.3, atol=0.05 * np.max(np.abs(modal)))
    assert np.all(modes.phase_collinearity < 0.97)
    arrays, attributes = encode(modes)
    again = decode(LinearModes, arrays, attributes)
    np.testing.assert_array_equal(again.accelerance(LINES_HZ), modes.accelerance(LINES_HZ))


def test_close_modes_and_coarse_lines_are_named() -> None:
    close = np.array([20.0, 33.0, 33.4])
    exact = accelerance(poles_hz=close, damping=DAMPING[[0, 1, 1]])
    notes = linear_modes(measured(5, 0.02, exact=exact), modes=list(close)).notes
    assert any("Hz are close: " in note and "MAC" in note for note in notes)
    exact = accelerance(damping=np.array([0.0008, 0.008, 0.002]))
    notes = linear_modes(measured(6, 0.02, exact=exact), modes=list(FREQUENCY_HZ)).notes
    assert any("Hz: half-power bandwidth" in note for note in notes)


@pytest.mark.parametrize("signs", [(-1.0, -1.0), (-1.0, 1.0)])
def test_a_reversed_force_or_drive_channel_is_refused_and_polarity_named(signs: tuple[float, float]) -> None:
    responses = measured(11, 0.1, exact=accelerance() * np.array(signs))
    for modes in (None, 3, list(FREQUENCY_HZ)):
        with refused(IdentificationError, "residue-of-polarity-of-force-or", field="modes"):
            linear_modes(responses, modes=modes)


def test_what_a_modal_analysis_needs_is_asked_for() -> None:
    responses = measured(7, 0.5)
    with refused(IdentificationError, "lines-are-too-few-for-block", field="frequency_hz"):
        linear_modes(responses.select(lowest_hz=20.0, highest_hz=20.1), orders=[40])
    with refused(IdentificationError, "the-responses-have-no-noise-covariance", field="weighting", value="noise"):
        linear_modes(responses, weighting="noise")
    noise = np.random.default_rng(0).normal(size=(2, LINES_HZ.size, 2)).view(np.complex128)
    empty = FrequencyResponseMatrix(
        outputs=CHANNELS, inputs=FORCE, frequency_hz=LINES_HZ, value=noise.reshape(-1, 2, 1)
    )
    with refused(IdentificationError, field="modes"):
        linear_modes(empty)


def test_a_band_that_is_narrow_against_its_frequency_tells_its_mode_or_that_there_is_none() -> None:
    responses = measured(10, 0.05)
    modes = linear_modes(responses, lowest_hz=52.0, highest_hz=68.0)
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ[2:], rtol=1e-4)
    np.testing.assert_allclose(modes.damping_ratio, DAMPING[2:], rtol=0.05)
    near = linear_modes(responses, lowest_hz=57.0, highest_hz=65.0, modes=[60.9])
    np.testing.assert_allclose(near.shapes, SHAPES[:, 2:], rtol=0.02)
    with refused(IdentificationError, field="modes"):
        linear_modes(responses, lowest_hz=40.0, highest_hz=48.0)


def test_the_stabilisation_diagram_shows_columns_at_the_modes() -> None:
    diagram = stabilisation(measured(8, 0.5))
    columns = diagram.columns()
    for frequency, damping in zip(FREQUENCY_HZ, DAMPING, strict=True):
        at = columns[np.argmin(np.abs(diagram.frequency_hz[columns] - frequency))]
        assert diagram.frequency_hz[at] == pytest.approx(frequency, rel=2e-3)
        assert diagram.damping_ratio[at] == pytest.approx(damping, rel=0.35)
        column = diagram.stable & (np.abs(diagram.frequency_hz / frequency - 1) < 0.01)
        assert np.unique(diagram.order[column]).size >= 10
    assert not np.any(diagram.stable & ~diagram.frequency_stable)
    with refused(IdentificationError, field="orders"):
        stabilisation(measured(8, 0.5), orders=[4, 0])


def test_two_forces_make_one_diagram() -> None:
    one = measured(9, 0.0).value[:, :, 0]
    s, omega = 2j * np.pi * LINES_HZ[:, None], 2 * np.pi * FREQUENCY_HZ
    two = s**2 / (s**2 + 2 * DAMPING * omega * s + omega**2) @ (SHAPES * SHAPES[1]).T + 0.2
    random = np.random.default_rng(9)
    value = np.stack([one, two], axis=2)
    value = value + 0.01 * (random.normal(size=value.shape) + 1j * random.normal(size=value.shape)) / np.sqrt(2.0)
    responses = FrequencyResponseMatrix(
        outputs=CHANNELS,
        inputs=(*FORCE, Channel("second", "force", "N")),
        frequency_hz=LINES_HZ,
        value=value,
        noise_covariance=np.broadcast_to(1e-4 * np.eye(4), (LINES_HZ.size, 4, 4)),
    )
    diagram = stabilisation(responses, range(2, 21, 2))
    found = diagram.frequency_hz[diagram.columns()]
    for frequency in FREQUENCY_HZ:
        assert np.min(np.abs(found / frequency - 1)) < 1e-3
    with refused(IdentificationError, "are-force-force-second-force", field="inputs"):
        linear_modes(responses)


def test_a_mode_that_is_there_is_not_left_out_of_the_fit_because_fewer_were_asked_for() -> None:
    with refused(IdentificationError, "wanted-but-left-out-pole-at", field="modes"):
        linear_modes(measured(3, 0.5), modes=2)


def test_errors_that_are_four_times_what_a_covariance_says_make_intervals_four_times_as_wide() -> None:
    known, believed = measured(5, 0.5), measured(5, 0.5)
    small = {
        name: getattr(believed, name) / 16.0
        for name in ("noise_covariance", "total_covariance")
        if getattr(believed, name) is not None
    }
    right = linear_modes(known, modes=list(FREQUENCY_HZ), orders=range(2, 15, 2))
    wrong = linear_modes(replace(believed, **small), modes=list(FREQUENCY_HZ), orders=range(2, 15, 2))
    assert small
    assert wrong.fit_residual == pytest.approx(4.0 * right.fit_residual, rel=0.02)
    for name in ("frequency_std_hz", "damping_ratio_std", "shapes_std"):
        np.testing.assert_allclose(getattr(wrong, name), getattr(right, name), rtol=0.15)
