import numpy as np
import pytest

from simulators.layout import RigState
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import EquationsOfMotion, ideal


def conservative(specimen: str, substeps: int) -> VirtualRig:
    """A rig without resistance, dampers and friction."""
    table = ideal(specimen).model_dump()
    return ideal(
        specimen,
        friction=(),
        structure=table["structure"] | {"damping_ratio": [0.0] * 4},
        exciter={"resistance_ohm": 0.0, "suspension_damping_n_s_m": 0.0},
        stinger={"damping_n_s_m": 0.0},
        converter={"substeps": substeps},
    )


def magnet_energy_j(rig: VirtualRig, z: float) -> float:
    """Integral of the restoring force from rest, in closed form."""
    strength, gap = rig.elements[0].strength_n_m4, rig.elements[0].gap_m
    near, rest = strength / (3 * (gap - z) ** 3), strength / (3 * gap**3)
    if rig.elements[0].one_sided:
        return near - rest - strength * z / gap**4
    return near + strength / (3 * (gap + z) ** 3) - 2 * rest


def energy_j(rig: VirtualRig, x: np.ndarray) -> float:
    equations, e = EquationsOfMotion(rig), rig.exciter
    q, v, x_a, v_a, i = x[:4], x[4:8], x[8], x[9], x[10]
    stretch = x_a - equations.drive @ q
    linear = v @ v + (equations.omega * q) @ (equations.omega * q) + e.armature_mass_kg * v_a**2
    linear += e.suspension_stiffness_n_m * x_a**2 + rig.stinger.stiffness_n_m * stretch**2 + e.inductance_h * i**2
    return float(linear / 2 + magnet_energy_j(rig, float(equations.rows[0] @ q)))


def drift(specimen: str, substeps: int) -> float:
    """Largest relative change of the energy over 0.4 s after a blow that brings the magnets to half their gap."""
    rig = conservative(specimen, substeps)
    simulation = Simulation(rig)
    state: RigState = simulation.state
    state.inputs[4:8] = [0.9, 0.1, 0.0, 0.0]
    energies = [energy_j(rig, state.inputs[:11])]
    largest = 0.0
    for _ in range(400):
        run = simulation.run(np.zeros(5))
        largest = max(largest, float(np.max(np.abs(run.displacement_m["magnet"]))))
        energies.append(energy_j(rig, state.inputs[:11]))
    assert 0.3 < largest / rig.elements[0].gap_m < 0.7
    return float(np.max(np.abs(np.array(energies) / energies[0] - 1.0)))


@pytest.mark.parametrize("specimen", ["magnet-beam", "magnet-beam-symmetric"])
def test_undriven_rig_without_losses_keeps_its_energy(specimen: str) -> None:
    errors = {substeps: drift(specimen, substeps) for substeps in (2, 4, 8)}
    assert errors[2] < 1e-3
    assert errors[4] / errors[8] > 3.0


def test_losses_only_ever_take_energy() -> None:
    rig = ideal(friction=())
    simulation = Simulation(rig)
    simulation.state.inputs[4:8] = [0.9, 0.1, 0.0, 0.0]
    energies = []
    for _ in range(400):
        simulation.run(np.zeros(5))
        energies.append(energy_j(rig, simulation.state.inputs[:11]))
    assert np.all(np.diff(energies) < 0.0)
    assert energies[-1] < 0.1 * energies[0]
