import numpy as np
import pytest

from tests.reference.coupled_rig import CoupledRig
from tests.reference.parameters import CALIBRATED, ONE_SIDED, SYMMETRIC
from tests.reference.time_integration import TimeDomain

BOTH = pytest.mark.parametrize(("rig", "key"), [(ONE_SIDED, "0"), (SYMMETRIC, "1")], ids=["one-sided", "symmetric"])


@BOTH
def test_linear_modes_with_magnets_are_the_calibrated_ones(rig: CoupledRig, key: str) -> None:
    k_lin = -float(rig.magnet_slope(np.zeros(1))[0])
    squares = np.linalg.eigvalsh(np.diag(rig.w_rad_s**2) + k_lin * np.outer(rig.phi_magnet, rig.phi_magnet))
    np.testing.assert_allclose(np.sqrt(squares), CALIBRATED["mag"][key]["wl"], rtol=1e-5)
    assert rig.linear_mode[0] / (2 * np.pi) == pytest.approx(24.37, abs=1e-3)


@BOTH
def test_linear_magnet_stiffness_is_the_closed_form(rig: CoupledRig, key: str) -> None:
    sides = 2 if rig.symmetric else 1
    expected = -4 * sides * CALIBRATED["mag"][key]["K0"] / 0.011**5
    assert float(rig.magnet_slope(np.zeros(1))[0]) == pytest.approx(expected, rel=1e-12)
    assert float(rig.magnet_force_n(np.zeros(1))[0]) == 0.0


@BOTH
def test_magnet_slope_is_the_derivative_of_the_force(rig: CoupledRig, key: str) -> None:
    z, step = np.linspace(-6e-3, 6e-3, 13), 1e-7
    slope = (rig.magnet_force_n(z + step) - rig.magnet_force_n(z - step)) / (2 * step)
    np.testing.assert_allclose(rig.magnet_slope(z), slope, rtol=1e-6)


def test_only_the_symmetric_pair_is_odd() -> None:
    z = np.array([3e-3])
    assert SYMMETRIC.magnet_force_n(-z) == pytest.approx(-SYMMETRIC.magnet_force_n(z), rel=1e-12)
    assert abs(ONE_SIDED.magnet_force_n(z)[0]) > 2 * abs(ONE_SIDED.magnet_force_n(-z)[0])


def test_the_beside_sensor_reads_more_than_the_drive_point_by_the_documented_ratio() -> None:
    for rig, ratio in ((ONE_SIDED, 1.113), (SYMMETRIC, 1.128)):
        assert rig.phi_sensors["acc_d"][0] / rig.phi_drive[0] == pytest.approx(ratio, abs=5e-4)


def test_the_coupled_plant_has_another_mode_than_the_structure() -> None:
    plant = TimeDomain(ONE_SIDED.without_friction(), 0.0, 1.0).equations
    linear = plant.linear + np.outer(plant.into[:, 0], plant.z_row) * float(ONE_SIDED.magnet_slope(np.zeros(1))[0])
    poles = np.linalg.eigvals(linear)
    first = min(poles[poles.imag > 1.0], key=abs)
    assert abs(first) / (2 * np.pi) == pytest.approx(25.1, abs=0.05)
    assert -first.real / abs(first) == pytest.approx(0.07, abs=0.005)
