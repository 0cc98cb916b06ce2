"""Harmonic balance and time integration share nothing but the equations of motion; here they meet."""

import numpy as np
import pytest

from tests.reference.coupled_rig import CoupledRig
from tests.reference.harmonic_balance import Periodic, backbone
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.time_integration import TimeDomain

BOTH = pytest.mark.parametrize("rig", [ONE_SIDED, SYMMETRIC], ids=["one-sided", "symmetric"])
PERIODS = 60


def differences(domain: TimeDomain, states: np.ndarray, expected: Periodic) -> tuple[float, float]:
    """Largest error of the first four force harmonics over F_1, and of the drive displacement's fundamental."""
    force = domain.harmonics(domain.force_n(states))
    drive = domain.harmonics(states @ domain.drive_row)
    error = np.max(np.abs(force[:5] - expected.force_n[:5])) / expected.force_amplitude_n
    return float(error), float(abs(drive[1] / expected.drive_m[1] - 1))


def test_without_friction_the_settled_rig_is_the_harmonic_balance() -> None:
    rig = ONE_SIDED.without_friction()
    expected = backbone(rig, [0.4])[0]
    domain = TimeDomain(rig, expected.voltage_v, expected.omega_rad_s)
    states = domain.without_friction(PERIODS)
    force, drive = differences(domain, states, expected)
    assert force < 1e-6
    assert drive < 1e-6
    # all power that passes the stinger ends in the modal dampers
    velocity = states[:, domain.mechanical : 2 * domain.mechanical - 1]
    dissipated = float(np.sum(2 * rig.zeta * rig.w_rad_s * np.mean(velocity**2, axis=0)))
    assert expected.active_power_w.sum() == pytest.approx(dissipated, rel=1e-6)


@BOTH
def test_with_friction_the_settled_rig_is_the_harmonic_balance(rig: CoupledRig) -> None:
    expected = backbone(rig, [0.56])[0]
    domain = TimeDomain(rig, expected.voltage_v, expected.omega_rad_s)
    force, drive = differences(domain, domain.with_return_map(PERIODS), expected)
    assert force < 3e-4
    assert drive < 3e-5


def test_friction_rates_and_return_map_give_the_same_motion() -> None:
    domain = TimeDomain(SYMMETRIC, 1.5, 2 * np.pi * 24.7, ramp_periods=4.0)
    # far from settled on purpose: history counts
    rates, mapped = domain.with_friction_rates(8), domain.with_return_map(8)
    largest = np.max(np.abs(domain.force_n(rates)))
    assert np.max(np.abs(domain.force_n(rates) - domain.force_n(mapped[::3]))) < 1e-3 * largest
