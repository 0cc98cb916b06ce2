"""Segalman's joint against its closed forms, and against the calibrated joints of the friction-joint beam."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from simulators.sites.friction import IwanSite
from tests.refused import refused

TABLE = {"kind": "iwan", "at": "joint", "stiffness_n_m": 2e8, "phi_max_m": 3e-6, "chi": -0.4, "beta": 0.7}
# Stiffness (N/m) and slip force (N) of the calibrated outermost joint: eight elements and an end slider.
CALIBRATED_STIFFNESS = (
    164156.6492, 185656.4499, 395628.5562, 843073.0768, 1796564.484,
    3828427.255, 8158268.394, 17385035.36, 22172868.27,
)  # fmt: skip
CALIBRATED_SLIP_FORCE_N = (
    0.007749969887, 0.02112939281, 0.07873622832, 0.2934014104, 1.09332628,
    4.074153402, 15.18185948, 56.57343611, 91.00185989,
)  # fmt: skip


def site(**changes: Any) -> IwanSite:
    return IwanSite.model_validate(TABLE | changes)


def lost_per_cycle_j(joint: IwanSite, amplitude_m: float) -> float:
    """Every slipping element loses four times its slip force times its slip travel."""
    stiffness, slip = np.array(joint.stiffness), np.array(joint.slip)
    return float(np.sum(4 * stiffness * slip * np.maximum(amplitude_m - slip, 0.0)))


def test_bins_are_those_of_the_calibrated_joint() -> None:
    # The calibration counts its beta per R phi_max^(chi+1), Segalman per R phi_max^(chi+1) / (chi+1).
    chi, beta = 0.3537867768075031, 0.5
    joint = site(stiffness_n_m=54929678.48797499, phi_max_m=4.104198832e-6, chi=chi, beta=beta * (chi + 1), n_element=8)
    assert joint.stiffness == pytest.approx(CALIBRATED_STIFFNESS, rel=1e-6)
    assert np.multiply(joint.stiffness, joint.slip) == pytest.approx(CALIBRATED_SLIP_FORCE_N, rel=1e-6)


@given(
    chi=st.floats(-0.95, 2.0),
    beta=st.floats(0.0, 10.0),
    n_element=st.integers(1, 40),
    first_bin=st.floats(1e-4, 0.5),
)
def test_stuck_stiffness_and_force_at_full_slip_are_exact_for_any_number_of_bins(
    chi: float, beta: float, n_element: int, first_bin: float
) -> None:
    joint = site(chi=chi, beta=beta, n_element=n_element, first_bin=first_bin)
    assert sum(joint.stiffness) == pytest.approx(joint.stiffness_n_m, rel=1e-12)
    assert np.dot(joint.stiffness, joint.slip) == pytest.approx(joint.full_slip_force_n, rel=1e-9)
    assert np.all(np.diff(joint.slip) > 0.0)
    assert max(joint.slip) <= joint.phi_max_m


def test_force_at_full_slip_is_the_integral_of_the_density() -> None:
    phi, step = np.linspace(0.0, 3e-6, 200_001, retstep=True)
    middle = phi[:-1] + step / 2
    density = middle**-0.4
    density *= 2e8 / (1 + 0.7) / (np.sum(density) * step)
    slider = 2e8 * 0.7 / 1.7 * 3e-6
    assert site().full_slip_force_n == pytest.approx(np.sum(density * middle) * step + slider, rel=1e-3)


@pytest.mark.parametrize("chi", [-0.5, 0.0, 0.35])
def test_micro_slip_loses_energy_with_the_power_three_plus_chi_of_the_amplitude(chi: float) -> None:
    joint = site(chi=chi, n_element=60, first_bin=1e-4)
    amplitudes = np.geomspace(0.02, 0.9, 12) * joint.phi_max_m
    lost = np.array([lost_per_cycle_j(joint, amplitude) for amplitude in amplitudes])
    density = joint.stiffness_n_m / (1 + joint.beta) * (chi + 1) / joint.phi_max_m ** (chi + 1)
    exact = 4 * density * amplitudes ** (chi + 3) / ((chi + 2) * (chi + 3))
    assert lost == pytest.approx(exact, rel=0.02)
    assert np.polyfit(np.log(amplitudes), np.log(lost), 1)[0] == pytest.approx(3 + chi, abs=0.02)


def test_few_elements_make_a_jagged_damping_curve() -> None:
    amplitudes = np.geomspace(0.1, 0.9, 200) * 3e-6

    def roughness(n_element: int) -> float:
        lost = np.array([lost_per_cycle_j(site(n_element=n_element), a) / a**2.6 for a in amplitudes])
        return float(np.ptp(lost) / np.mean(lost))

    assert roughness(16) < roughness(8) < roughness(4)


def test_there_are_eight_elements_and_a_slider_unless_said_otherwise() -> None:
    assert len(site().stiffness) == 9
    assert site().slip[-1] == TABLE["phi_max_m"]
    assert len(site(beta=0.0).stiffness) == 8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"chi": -1.0}, {"field": "chi", "value": -1.0}),
        ({"beta": -0.1}, {"field": "beta", "value": -0.1}),
        ({"phi_max_m": 0.0}, {"field": "phi_max_m", "value": 0.0}),
        ({"n_element": 0}, {"field": "n_element", "value": 0}),
        ({"relative_to_mode_1": True}, {"field": "relative_to_mode_1", "value": True}),
    ],
)
def test_bad_joint_is_refused_with_the_field_and_what_is_allowed(
    change: dict[str, Any], message: dict[str, object]
) -> None:
    with refused(ValidationError, **message):
        site(**change)
