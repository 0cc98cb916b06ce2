from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification import Backbone, Channel, IdentificationError, PeriodicVibration
from identification.measurements import wrapped_deg
from tests.identification.rigs import CHANNELS, one_mode_point


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
        ({"frequency_hz": float("nan")}, "frequency_hz: is nan Hz, must be finite and above zero"),
        ({"periods": 0}, "periods: is 0, needs at least 1"),
        ({"residual_rms": np.zeros(3)}, r"residual_rms: shape \(3,\) for 2 channels"),
        ({"harmonics": np.ones((2, 1))}, "needs harmonics 0 and 1 at least"),
        ({"harmonics": np.array([[0, np.inf], [0, 1]])}, r"harmonics: value at \[0, 1\]"),
        ({"harmonics_std": np.ones((2, 5))}, r"harmonics_std: shape \(2, 5\), harmonics have \(2, 2\)"),
        ({"channels": (CHANNELS[0], Channel("a", "response", "m"))}, "0 have the role 'drive', needs exactly one"),
        ({"channels": (Channel("drive", "force", "N"), CHANNELS[1])}, "names are not unique"),
    ],
)
def test_unusable_vibrations_are_refused_by_name(change: dict[str, Any], message: str) -> None:
    with pytest.raises(IdentificationError, match=message):
        replace(one_mode_point(), **change)


def test_channels_of_wrong_role_or_unit_are_refused() -> None:
    with pytest.raises(IdentificationError, match="role is 'shaker', allowed are force, drive, response, monitor"):
        Channel("x", "shaker", "N")
    with pytest.raises(IdentificationError, match="channel 'f': unit is 'lbf', a force is given in N"):
        Channel("f", "force", "lbf")
    with pytest.raises(IdentificationError, match="channel 'a': unit is 'g', a motion is in m, m/s or m/s2"):
        Channel("a", "drive", "g")


@pytest.mark.parametrize("unit", ["V", "1"])
def test_a_force_without_a_better_unit_may_be_in_volts_but_not_in_a_backbone(unit: str) -> None:
    force, drive = Channel("f", "force", unit), Channel("x", "drive", unit)
    assert drive.motion == "displacement"
    with pytest.raises(
        IdentificationError, match=f"channel 'f': unit is '{unit}'; a periodic vibration needs a force in N"
    ):
        PeriodicVibration((force, drive), 20.0, np.ones((2, 2), dtype=complex), 10, np.zeros(2))


def test_a_measurement_cannot_be_changed_afterwards() -> None:
    harmonics = np.ones((2, 2), dtype=complex)
    point = PeriodicVibration(CHANNELS, 20.0, harmonics, 10, np.zeros(2))
    harmonics[0, 1] = 5.0
    assert point.force_n == 1.0
    with pytest.raises(ValueError, match="read-only"):
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
    with pytest.raises(IdentificationError, match="points: a backbone needs at least one"):
        Backbone(())
    with pytest.raises(IdentificationError, match=r"points\[1\]: channels or harmonics differ"):
        Backbone((point, one_mode_point(unit="m")))
    with pytest.raises(IdentificationError, match=r"drive_mode_shape: is 0\.0"):
        Backbone((point,), drive_mode_shape=0.0)
    with pytest.raises(IdentificationError, match="directions: 'left' given, allowed are up and down"):
        Backbone((point,), directions=("left",))
    with pytest.raises(IdentificationError, match="repeats: 2 given for 1 points"):
        Backbone((point,), repeats=(1, 2))
