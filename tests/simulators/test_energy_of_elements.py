import numpy as np
import pytest

from simulators.simulation import Simulation
from simulators.sites.elements import Clearance, Cubic, Element, Magnet, User
from simulators.virtual_rig import VirtualRig
from tests.simulators.references import ideal

ELEMENTS = [
    {"kind": "clearance", "at": "tip_right", "gap_m": 1e-5, "other_gap_m": 2e-5, "contact_stiffness_n_m": 2e6},
    {"kind": "cubic", "at": "tip_left", "linear_n_m": 3e5, "quadratic_n_m2": 3e9, "stiffness_n_m3": 4e14},
    {"kind": "magnet-one-sided", "at": "tip_left", "strength_n_m4": 3e-14, "gap_m": 3e-4},
    {"kind": "magnet-symmetric", "at": "tip_right", "to": "drive", "strength_n_m4": 1e-14, "gap_m": 3e-4},
    {
        "kind": "user",
        "at": "drive",
        "function": "tests.simulators.sites.test_elements:cubic_of_a_user",
        "parameters": [3e14],
    },
]


def lossless(elements: list[dict[str, object]], rate_hz: float) -> VirtualRig:
    """The friction beam with nothing that damps but its joints, one integration step per sample."""
    return ideal(
        "friction-beam",
        elements=elements,
        structure={"damping_ratio": [0.0] * 6},
        exciter={"resistance_ohm": 0.0, "suspension_damping_n_s_m": 0.0},
        stinger={"damping_n_s_m": 0.0},
        converter={"sample_rate_hz": rate_hz, "substeps": 1, "oversampling": 1, "anti_alias_hz": 0.0},
    )


def potential_j(element: Element, z: float) -> float:
    """Potential of an element in closed form, without that of its linear part."""
    if isinstance(element, Clearance):
        assert element.other_gap_m is not None
        pressed = max(z - element.gap_m, 0.0), max(-z - element.other_gap_m, 0.0)
        return element.contact_stiffness_n_m * (pressed[0] ** 2 + pressed[1] ** 2) / 2
    if isinstance(element, Cubic):
        return element.quadratic_n_m2 * z**3 / 3 + element.stiffness_n_m3 * z**4 / 4
    if isinstance(element, User):
        return element.parameters[0] * z**4 / 4
    assert isinstance(element, Magnet)
    k0, gap = element.strength_n_m4, element.gap_m
    whole = k0 / (3 * (gap - z) ** 3) - k0 / (3 * gap**3)
    whole += -k0 * z / gap**4 if element.one_sided else k0 / (3 * (gap + z) ** 3) - k0 / (3 * gap**3)
    return whole - element.stiffness_n_m * z**2 / 2


def mechanical_j(rig: VirtualRig, x: np.ndarray) -> float:
    """Kinetic and potential energy of everything but the joints' elements."""
    plant, e, m = rig.plant, rig.exciter, rig.plant.n_mode
    q, v, x_a, v_a, i = x[:m], x[m : 2 * m], *x[2 * m :]
    twice = v @ v + q @ plant.modal_stiffness @ q + e.armature_mass_kg * v_a**2 + e.inductance_h * i**2
    twice += e.suspension_stiffness_n_m * x_a**2 + rig.stinger.stiffness_n_m * (x_a - plant.drive_shape @ q) ** 2
    coordinates = plant.site_rows @ x
    twice -= sum(
        joint.stuck_stiffness * z**2 for joint, z in zip(rig.friction, coordinates[plant.n_local :], strict=True)
    )
    local = [potential_j(element, z) for element, z in zip(rig.elements, coordinates[: plant.n_local], strict=True)]
    return float(twice / 2 + sum(local))


def balance(elements: list[dict[str, object]], rate_hz: float) -> tuple[float, float]:
    """Largest error of stored plus dissipated energy over 40 ms after a blow, and what was dissipated, over the blow's."""
    rig = lossless(elements, rate_hz)
    simulation = Simulation(rig)
    state, n = simulation.state, rig.plant.dynamics.shape[0]
    state.inputs[8] = 0.12  # velocity of the first bending mode
    start = mechanical_j(rig, state.inputs[:n])
    stiffness, limits = simulation.arrays.elements
    used = stiffness > 0.0
    dissipated, worst = 0.0, 0.0
    force, deflection = state.friction.copy(), state.deflection.copy()
    for _ in range(round(0.04 * rate_hz)):
        simulation.run([0.0])
        slip = (state.deflection - deflection)[None, :] - np.where(
            used, (state.friction - force) / np.where(used, stiffness, 1.0), 0.0
        )
        dissipated += float(np.sum(state.friction * slip))
        force, deflection = state.friction.copy(), state.deflection.copy()
        stored = float(np.sum(force[used] ** 2 / (2 * stiffness[used])))
        worst = max(worst, abs(mechanical_j(rig, state.inputs[:n]) + stored + dissipated - start) / start)
    assert np.all(np.abs(force) <= limits)
    return worst, dissipated / start


@pytest.mark.parametrize("element", ELEMENTS, ids=lambda element: element["kind"])
def test_energy_of_an_undriven_rig_is_stored_or_dissipated_in_its_joints(element: dict[str, object]) -> None:
    fine, dissipated = balance([element], 40_000.0)
    coarse, _ = balance([element], 20_000.0)
    assert dissipated > 0.02
    assert fine < 2e-3
    assert fine < 0.6 * coarse


def test_each_element_matters_in_its_balance() -> None:
    rig = lossless(ELEMENTS, 40_000.0)
    simulation = Simulation(rig)
    simulation.state.inputs[8] = 0.12
    largest = np.zeros(len(ELEMENTS))
    for _ in range(400):
        simulation.run([0.0])
        z = (rig.plant.site_rows @ simulation.state.inputs[:15])[: len(ELEMENTS)]
        largest = np.maximum(largest, [abs(potential_j(e, d)) for e, d in zip(rig.elements, z, strict=True)])
    assert np.all(largest > 1e-3 * 0.12**2 / 2), largest
