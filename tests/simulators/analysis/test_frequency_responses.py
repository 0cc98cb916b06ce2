import numpy as np
import pytest

from simulators.analysis.frequency_responses import frequency_response
from simulators.simulation import Simulation
from tests.refused import refused
from tests.simulators.analysis.rigs import DAMPING_RATIO, FREQUENCY_HZ, SHAPE, one_mode
from tests.simulators.references import ideal

FREQUENCIES_HZ = np.array([5.0, 24.37, 39.9, 60.0, 134.06, 700.0])


def test_receptance_of_one_mode_is_the_closed_form() -> None:
    found = frequency_response(one_mode(), FREQUENCIES_HZ)
    s, w = 2j * np.pi * FREQUENCIES_HZ, 2 * np.pi * FREQUENCY_HZ
    expected = SHAPE**2 / (s**2 + 2 * DAMPING_RATIO * w * s + w**2)
    np.testing.assert_allclose(found.receptance_m_per_n["drive"], expected, rtol=1e-12)
    np.testing.assert_allclose(found.accelerance_per_kg["drive"], s**2 * expected, rtol=1e-12)


def test_force_per_voltage_of_one_mode_is_the_closed_form() -> None:
    rig = one_mode()
    e, k = rig.exciter, rig.stinger
    s = 2j * np.pi * FREQUENCIES_HZ
    receptance = frequency_response(rig, FREQUENCIES_HZ).receptance_m_per_n["drive"]
    coil = e.inductance_h * s + e.resistance_ohm
    armature = e.armature_mass_kg * s**2 + e.suspension_damping_n_s_m * s + e.suspension_stiffness_n_m
    armature = armature + s * e.force_factor_n_a**2 / coil
    stinger = 1 / (1 / (k.stiffness_n_m + s * k.damping_n_s_m) + receptance)
    expected = stinger * e.force_factor_n_a / coil / (armature + stinger)
    np.testing.assert_allclose(frequency_response(rig, FREQUENCIES_HZ).force_n_per_v, expected, rtol=1e-9)


def test_the_structure_alone_is_what_the_coupled_rig_has_from_force_to_motion() -> None:
    found = frequency_response(ideal(), FREQUENCIES_HZ)
    for at, receptance in found.receptance_m_per_n.items():
        np.testing.assert_allclose(found.displacement_m_per_v[at] / found.force_n_per_v, receptance, rtol=1e-8)
    acceleration = found.sensor_per_v["acc_magnet"] / found.force_n_per_v
    np.testing.assert_allclose(acceleration, found.accelerance_per_kg["acc_magnet"], rtol=1e-8)


def test_linear_modes_have_the_shapes_whose_sum_is_the_receptance() -> None:
    rig = ideal(elements=[], friction=[])
    modes = rig.linear_modes
    s, w = 2j * np.pi * FREQUENCIES_HZ[:, None], 2 * np.pi * modes.frequency_hz
    terms = modes.at(rig.shape("tip")) * modes.drive_shape / (s**2 + 2 * modes.damping_ratio * w * s + w**2)
    found = frequency_response(rig, FREQUENCIES_HZ).receptance_m_per_n["tip"]
    np.testing.assert_allclose(found, terms.sum(axis=1), rtol=1e-9)


@pytest.mark.parametrize("frequency_hz", [25.0, 625.0])
def test_held_is_what_a_simulation_samples(frequency_hz: float) -> None:
    rig = ideal(elements=[], friction=[])
    n = round(rig.converter.sample_rate_hz / frequency_hz)
    run = Simulation(rig).run(np.cos(2 * np.pi * np.arange(n * round(60 * frequency_hz)) / n))
    turn = np.exp(-2j * np.pi * np.arange(n) / n) * 2 / n
    found = frequency_response(rig, frequency_hz, held=True)
    assert found.force_n_per_v[0] == pytest.approx(run.force_n[-n:] @ turn, rel=1e-7)
    assert found.sensor_per_v["drive"][0] == pytest.approx(run.measured["drive"][-n:] @ turn, rel=1e-7)
    continuous = frequency_response(rig, frequency_hz)
    hold = np.sinc(1 / n) * np.exp(-1j * np.pi / n)
    assert abs(found.displacement_m_per_v["drive"] / continuous.displacement_m_per_v["drive"] / hold - 1) < 1e-3


def test_bad_frequencies_are_named() -> None:
    with refused(ValueError, field="frequencies_hz", value=0.0, allowed="above 0"):
        frequency_response(one_mode(), [10.0, 0.0])
    with refused(ValueError, field="frequencies_hz", value=2500.0, allowed="below 2500, half the sample rate"):
        frequency_response(one_mode(), [2500.0], held=True)
