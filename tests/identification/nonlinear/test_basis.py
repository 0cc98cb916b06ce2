"""Modes and channels of a linear modal analysis, mapped to a backbone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification import Backbone, Channel, IdentificationError, LinearModes, nonlinear_mode
from identification.nonlinear.basis import shapes_for
from tests.identification.nonlinear.test_uncertainty import SHAPE, noisy_point
from tests.refused import refused


def linear_modes(
    frequency_hz: Sequence[float] = (24.37, 134.0),
    names: Sequence[str] = ("tip", "drive"),
    shapes: Sequence[Sequence[float]] = ((3.1, -2.0), (1.7, 1.5)),
    std: float = 0.0,
) -> LinearModes:
    n, rows = len(frequency_hz), len(names)
    return LinearModes(
        channels=tuple(Channel(name, "drive" if name == "drive" else "response", "m/s2") for name in names),
        frequency_hz=np.array(frequency_hz),
        frequency_std_hz=np.zeros(n),
        damping_ratio=np.full(n, 0.004),
        damping_ratio_std=np.zeros(n),
        shapes=np.array(shapes),
        shapes_std=np.full((rows, n), std),
        phase_collinearity=np.ones(n),
        lower=np.zeros(rows, complex),
        upper=np.zeros(rows, complex),
        lowest_hz=10.0,
        highest_hz=500.0,
    )


BACKBONE = Backbone((noisy_point(forces=(0, 0.1, 0)), noisy_point(forces=(0, 0.3, 0))), "beam")


def test_channels_are_mapped_by_name_whatever_their_order() -> None:
    mode = nonlinear_mode(BACKBONE, modes=linear_modes())
    np.testing.assert_allclose(mode.damping_ratio, 0.004, rtol=1e-9)
    np.testing.assert_allclose(mode.mac, 1.0, rtol=1e-12)
    assert all("only: the intervals" in note for note in mode.notes)
    found, tested, _ = shapes_for(linear_modes(), BACKBONE)
    assert (found.channels, tested) == (("drive", "tip"), 0)
    np.testing.assert_array_equal(found.tested, SHAPE)


def test_a_mode_near_the_tested_one_is_told_apart_from_it() -> None:
    modes = linear_modes((24.37, 27.0), shapes=((3.1, -2.0), (1.7, 1.5)))
    found, _, _ = shapes_for(modes, BACKBONE)
    assert found.shapes.shape == (2, 2)
    with refused(IdentificationError, "closely-spaced-ones-common-channels-meas", field="modes"):
        shapes_for(linear_modes((23.0, 24.37, 27.0), shapes=((3, 3.1, -2), (-1.7, 1.7, 1.5))), BACKBONE)
    with refused(IdentificationError, "hz-look-alike-measure-where-their", field="modes"):
        shapes_for(linear_modes((24.37, 27.0), shapes=((3.1, 3.2), (1.7, 1.6))), BACKBONE)


def test_the_tested_mode_is_refused_where_the_frequency_does_not_say_which() -> None:
    with refused(IdentificationError, "near-to-and-hz-alike-say", field="modes"):
        shapes_for(linear_modes((24.34, 24.41)), BACKBONE)
    assert shapes_for(linear_modes((24.34, 24.41)), BACKBONE, mode=1)[1] == 1
    with refused(IdentificationError, "none-lies-within-of-hz", field="modes"):
        shapes_for(linear_modes((50.0, 134.0)), BACKBONE)
    with refused(IdentificationError, field="mode", value=2, allowed="0 to 1"):
        nonlinear_mode(BACKBONE, modes=linear_modes(), mode=2)
    with refused(IdentificationError, "there-are-no-modes-to-choose", field="mode", value=0):
        nonlinear_mode(BACKBONE, mode=0)


def test_a_sensor_that_the_modal_model_does_not_know_is_left_out_and_named() -> None:
    modes = linear_modes(names=("other", "drive"))
    mode = nonlinear_mode(BACKBONE, modes=modes)
    assert "channel 'tip' is not" in mode.notes[0]
    np.testing.assert_allclose(mode.damping_ratio, 0.004, rtol=1e-9)
    moved = replace(modes, channels=(Channel("drive", "response", "m/s2"), Channel("hammer", "drive", "m/s2")))
    with refused(IdentificationError, "backbone-drive-point-is-drive-the", field="modes"):
        nonlinear_mode(BACKBONE, modes=moved)


def test_mixed_units_show_in_the_shape_of_the_lowest_level() -> None:
    wrong = tuple(replace(p, harmonics=p.harmonics * np.array([[1], [1], [1 / 9.81]])) for p in BACKBONE.points)
    mode = nonlinear_mode(replace(BACKBONE, points=wrong), modes=linear_modes())
    assert "channel 'tip' moves 0.102" in mode.notes[0]


def test_errors_of_the_shapes_are_carried_through_and_missing_ones_named() -> None:
    mode = nonlinear_mode(BACKBONE, modes=linear_modes(std=0.02))
    q_std = 0.02 / np.linalg.norm(SHAPE)  # of the projection on the shape
    np.testing.assert_allclose(mode.systematic("modal_amplitude") / mode.modal_amplitude, q_std, rtol=0.1)
    unknown = nonlinear_mode(BACKBONE, modes=linear_modes(std=np.nan))
    assert any("errors of some mode shapes" in note for note in unknown.notes)


def test_the_covariance_of_the_chosen_shape_values_comes_along_in_the_backbones_order() -> None:
    modes = linear_modes()
    values = np.arange(1.0, 9.0)  # two frequencies, two dampings, tip in modes 1 and 2, drive in modes 1 and 2
    found, _, _ = shapes_for(replace(modes, covariance=np.outer(values, values)), BACKBONE)
    np.testing.assert_array_equal(found.covariance, np.outer([7.0, 5.0], [7.0, 5.0]))
    unknown, _, _ = shapes_for(replace(modes, covariance=np.full((8, 8), np.nan)), BACKBONE)
    assert unknown.covariance is None
