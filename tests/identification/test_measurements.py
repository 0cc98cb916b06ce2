from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification import Backbone, Channel, IdentificationError, PeriodicVibration
from identification.measurements import wrapped_deg
from tests.identification.rigs import CHANNELS, one_mode_point
from tests.refused import refused


@pytest.mark.parametrize("unit", ["m", "m/s", "m/s2"])
@pytest.mark.parametrize("lag_deg", [40.0, 90.0, 120.0])
def test_the_phase_lag_is_that_of_the_displacement_whatever_is_measured(unit: str, lag_deg: float) -> None:
    point = one_mode_point(lag_deg, unit=unit)
    assert point.phase_lag_deg == pytest.approx(lag_deg, abs=1e-9)
    assert point.phase_error_deg == pytest.approx(90.0 - lag_deg, abs=1e-9)
    assert point.amplitude_m == pytest.approx(one_mode_point(lag_deg, unit="m").amplitude_m, rel=1e-12)


def test_at_resonance_the_acceleration_leads_the_force_by_a_quarter_turn() -> None:
    point = one_mode_point(90.0)
    lag = np.degrees(np.angle(point.harmonics[0, 1]) - np.angle(point.harmonics[1, 1]))
    assert lag == pytest.approx(-90.0)


def test_the_static_displacement_is_unknown_from_an_acceleration() -> None:
    assert np.isnan(one_mode_point(forces=(0.1, 0.3)).drive_m[0])
    assert one_mode_point(forces=(0.1, 0.3), unit="m").drive_m[0] > 0.0


def test_wrapping_leaves_plus_180_and_moves_minus_180() -> None:
    assert [wrapped_deg(angle) for angle in (180.0, -180.0, 270.0, -30.0, 540.0)] == [180.0, 180.0, -90.0, -30.0, 180.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"frequency_hz": float("nan")},
            {"says": "nan-hz", "field": "frequency_hz", "allowed": "finite and above zero"},
        ),
        ({"periods": 0}, {"field": "periods", "value": 0, "allowed": "1 and above"}),
        ({"residual_rms": np.zeros(3)}, {"says": "shape-for-channels", "field": "residual_rms"}),
        ({"harmonics": np.ones((2, 1))}, {"field": "harmonics", "allowed": "harmonics 0 and 1 at least"}),
        ({"harmonics": np.array([[0, np.inf], [0, 1]])}, {"says": "value-at-3", "field": "harmonics"}),
        ({"harmonics_std": np.ones((2, 5))}, {"says": "shape-harmonics-have", "field": "harmonics_std"}),
        (
            {"channels": (CHANNELS[0], Channel("a", "response", "m"))},
            {"says": "have-the-role-drive", "field": "channels", "allowed": "exactly one"},
        ),
        (
            {"channels": (Channel("drive", "force", "N"), CHANNELS[1])},
            {"says": "names-are-not-unique", "field": "channels"},
        ),
    ],
)
def test_unusable_vibrations_are_refused_by_name(change: dict[str, Any], message: str) -> None:
    with refused(IdentificationError, **message):
        replace(one_mode_point(), **change)


def test_channels_of_wrong_role_or_unit_are_refused() -> None:
    with refused(IdentificationError, field="role", value="shaker", allowed="force, drive, response, monitor"):
        Channel("x", "shaker", "N")
    with refused(IdentificationError, "force-is-given-in", field="unit", value="lbf"):
        Channel("f", "force", "lbf")
    with refused(IdentificationError, "motion-is-in-or", field="unit", value="g"):
        Channel("a", "drive", "g")


@pytest.mark.parametrize("unit", ["V", "1"])
def test_a_force_without_a_better_unit_may_be_in_volts_but_not_in_a_backbone(unit: str) -> None:
    force, drive = Channel("f", "force", unit), Channel("x", "drive", unit)
    assert drive.motion == "displacement"
    with refused(IdentificationError, "a-periodic-vibration-needs", where="channel 'f'", field="unit", value=unit):
        PeriodicVibration((force, drive), 20.0, np.ones((2, 2), dtype=complex), 10, np.zeros(2))


def test_a_measurement_cannot_be_changed_afterwards() -> None:
    harmonics = np.ones((2, 2), dtype=complex)
    point = PeriodicVibration(CHANNELS, 20.0, harmonics, 10, np.zeros(2))
    harmonics[0, 1] = 5.0
    assert point.force_n == 1.0
    with refused(ValueError, "read-only"):
        point.harmonics[0, 1] = 2.0


def test_a_backbone_keeps_the_order_and_the_labels_of_its_points() -> None:
    points = [replace(one_mode_point(forces=(0.0, force)), settled=force != 0.2) for force in (0.1, 0.2, 0.3)]
    backbone = Backbone(tuple(points), "beam", 1.7, ("up", "up", "down"), (1, 1, 2))
    np.testing.assert_allclose(backbone.force_n, [0.1, 0.2, 0.3])
    settled = backbone.settled()
    np.testing.assert_allclose(settled.force_n, [0.1, 0.3])
    assert (settled.directions, settled.repeats, settled.specimen) == (("up", "down"), (1, 2), "beam")


def test_unusable_backbones_are_refused_by_name() -> None:
    point = one_mode_point()
    with refused(IdentificationError, "backbone-needs-at-least-one", field="points"):
        Backbone(())
    with refused(IdentificationError, "channels-or-harmonics-differ", field="points[1]"):
        Backbone((point, one_mode_point(unit="m")))
    with refused(IdentificationError, field="drive_mode_shape", value=0.0):
        Backbone((point,), drive_mode_shape=0.0)
    with refused(IdentificationError, "left-given", field="directions", allowed="up and down"):
        Backbone((point,), directions=("left",))
    with refused(IdentificationError, "given-for-points", field="repeats"):
        Backbone((point,), repeats=(1, 2))
