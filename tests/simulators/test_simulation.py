import numpy as np
import pytest

from simulators.layout import Flag
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.references import ideal

RATE_HZ = 5000.0


def sine(amplitude_v: float, frequency_hz: float, n: int) -> np.ndarray:
    return amplitude_v * np.cos(2 * np.pi * frequency_hz / RATE_HZ * np.arange(n))


def fundamental(signal: np.ndarray, frequency_hz: float, n_period: int) -> complex:
    n = round(n_period * RATE_HZ / frequency_hz)
    first = signal.size - n
    return complex(
        2 * np.mean(signal[first:] * np.exp(-2j * np.pi * frequency_hz / RATE_HZ * np.arange(first, signal.size)))
    )


def linear_frf(rig: VirtualRig, frequency_hz: float) -> tuple[complex, complex]:
    """Force and drive acceleration per volt of the rig linearised at rest, from its equations of motion."""
    w = 2 * np.pi * frequency_hz
    phi, e, s = rig.shape("drive"), rig.exciter, rig.stinger
    stiffness = np.diag(rig.structure.omega_rad_s**2).astype(complex)
    stiffness += rig.elements[0].stiffness_n_m * np.outer(rig.shape("magnet"), rig.shape("magnet"))
    damping = np.diag(2 * np.array(rig.structure.damping_ratio) * rig.structure.omega_rad_s)
    receptance = phi @ np.linalg.solve(stiffness + 1j * w * damping - w**2 * np.eye(4), phi)
    rod = s.stiffness_n_m + 1j * w * s.damping_n_s_m
    seen = rod / (1 + rod * receptance)
    armature = e.suspension_stiffness_n_m + 1j * w * e.suspension_damping_n_s_m - w**2 * e.armature_mass_kg + seen
    coil = e.resistance_ohm + 1j * w * e.inductance_h
    x_a = e.force_factor_n_a / (coil * armature + 1j * w * e.force_factor_n_a**2)
    return seen * x_a, -(w**2) * receptance * seen * x_a


@pytest.mark.parametrize("frequency_hz", [20.0, 25.0, 40.0, 125.0])
def test_small_vibrations_have_the_frequency_response_of_the_linear_rig(frequency_hz: float) -> None:
    rig = ideal(friction=())
    n = 20_000
    run = Simulation(rig).run(sine(1e-4, frequency_hz, n))
    force, acceleration = linear_frf(rig, frequency_hz)
    # The held voltage is half a sample late and has lost sinc(f / rate).
    held = 1e-4 * np.sinc(frequency_hz / RATE_HZ) * np.exp(-1j * np.pi * frequency_hz / RATE_HZ)
    for name, frf in (("force", force), ("drive", acceleration)):
        assert fundamental(run.measured[name], frequency_hz, 20) == pytest.approx(frf * held, rel=2e-3)


def test_force_drops_out_near_resonance() -> None:
    # Held voltage: the shaker gives way to the resonant structure.
    rig = ideal(friction=())
    forces = {}
    for frequency_hz in (18.0, 24.37, 32.0):
        run = Simulation(rig).run(sine(0.02, frequency_hz, 25_000))
        forces[frequency_hz] = abs(fundamental(run.force_n, frequency_hz, 20))
    assert forces[24.37] < 0.1 * min(forces[18.0], forces[32.0])


def test_strong_resonant_force_of_a_one_sided_magnet_is_mostly_harmonics() -> None:
    # At phase resonance at 0.5 N the documents have F2/F1 = 1.8; a drive close to it must show the same nature.
    run = Simulation(VirtualRig.shipped("magnet-beam")).run(sine(2.5, 25.2, 40_000))
    harmonics = [abs(fundamental(run.force_n, h * 25.2, 20 * h)) for h in (1, 2, 3)]
    assert harmonics[1] > 0.5 * harmonics[0]
    assert harmonics[2] > 0.1 * harmonics[0]


def test_acceleration_is_the_second_derivative_of_displacement() -> None:
    run = Simulation(ideal()).run(sine(2.0, 24.4, 4000))
    x = run.displacement_m["drive"]
    second = (x[2:] - 2 * x[1:-1] + x[:-2]) * RATE_HZ**2
    smooth = slice(500, None)
    measured = run.measured["drive"][1:-1]
    band = np.convolve(second - measured, np.ones(20) / 20, mode="same")[smooth]
    assert np.sqrt(np.mean(band**2)) < 5e-3 * np.sqrt(np.mean(measured[smooth] ** 2))


def test_sensors_are_read_before_the_voltage_acts() -> None:
    run = Simulation(ideal()).run([5.0, 0.0, 0.0])
    assert run.measured["force"][0] == 0.0
    assert run.measured["force"][1] != 0.0


def test_magnet_that_leaves_its_range_is_flagged_and_the_state_stays_finite() -> None:
    run = Simulation(VirtualRig.shipped("magnet-beam")).run(sine(10.0, 25.5, 10_000))
    beyond = np.abs(run.displacement_m["magnet"]) > 0.7 * 0.011
    assert beyond.any()
    assert run.flag & Flag.LAW_RANGE
    assert not run.flag & Flag.DIVERGED
    # The flag of a sample tells of the way to the next instant.
    flagged = (run.flags & Flag.LAW_RANGE) != 0
    assert np.all(flagged[:-1][beyond[1:]])


def test_run_goes_on_where_the_last_one_ended() -> None:
    voltages = sine(1.0, 24.0, 600)
    whole = Simulation(VirtualRig.shipped("magnet-beam"), seed=5).run(voltages)
    simulation = Simulation(VirtualRig.shipped("magnet-beam"), seed=5)
    first, second = simulation.run(voltages[:250]), simulation.run(voltages[250:])
    for name, signal in whole.measured.items():
        assert np.array_equal(signal, np.concatenate([first.measured[name], second.measured[name]]))
    assert second.time_s[0] == 250 / RATE_HZ


def test_voltages_in_the_wrong_shape_are_refused() -> None:
    with refused(ValueError, "shape-3", field="voltages", allowed="one row of at least one number"):
        Simulation(VirtualRig.shipped("magnet-beam")).run(np.zeros((2, 2)))
