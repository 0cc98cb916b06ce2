from itertools import pairwise

import numpy as np
import pytest

from simulators.layout import CHANNEL, CONVERTER, PLANT, SITE, RigArrays, RigState
from simulators.plant.compilation import at_rest, jenkins_elements
from simulators.plant.kernels import advance
from simulators.simulation import Simulation
from simulators.sites.friction import JenkinsSite
from simulators.stepping import run_open_loop
from tests.simulators.references import ideal

STIFFNESS = np.array([3.0, 2.0, 1.5, 0.7, 0.4])
SLIP = np.array([0.1, 0.25, 0.5, 0.9, 1.6])
STEP = 0.005


def imposed_joint() -> tuple[RigArrays, RigState]:
    """One friction joint whose coordinate is the voltage: its deflection is imposed."""
    joint = JenkinsSite(kind="jenkins", at="joint", stiffness=tuple(STIFFNESS), slip=tuple(SLIP))
    elements = jenkins_elements([joint])
    step = np.zeros((8, 8))
    step[1, 0] = 1.0
    rig = RigArrays(
        plant=np.array([(1, 0, 1, 1, np.inf)], PLANT),
        step=step,
        correct=np.zeros((1, 8)),
        sites=np.zeros(0, SITE),
        elements=elements,
        stuck=elements[0].sum(axis=0),
        sense=np.zeros((8, 8)),
        channels=np.zeros(1, CHANNEL),
        conditioning=np.zeros((5, 8)),
        converter=np.zeros(1, CONVERTER),
        noise_keys=np.zeros(2, np.uint64),
        sections=np.zeros((0, 5, 8)),
        reconstruction=np.zeros((0, 5)),
        taps=np.zeros((1, 1)),
    )
    return rig, at_rest(rig)


def joint_forces(deflections: np.ndarray) -> np.ndarray:
    """Restoring force of the whole joint, its stuck part included, along a path from rest."""
    rig, state = imposed_joint()
    forces = []
    for deflection in deflections:
        advance(rig, state, deflection)
        forces.append(STIFFNESS.sum() * deflection - state.inputs[2])
    return np.array(forces)


def first_loading(deflection: np.ndarray) -> np.ndarray:
    """Closed form: every element is stiff up to its slip deflection, then carries its slip force."""
    return np.sum(STIFFNESS * np.minimum(deflection[:, None], SLIP), axis=1)


def path(*turning_points: float) -> np.ndarray:
    """Even steps, so that the turning points are those given."""
    legs = (np.linspace(a, b, round(abs(b - a) / STEP) + 1)[1:] for a, b in pairwise(turning_points))
    return np.concatenate(list(legs))


def test_first_loading_is_the_closed_form() -> None:
    deflection = path(0.0, 1.3)
    assert joint_forces(deflection) == pytest.approx(first_loading(deflection), abs=1e-12)


def test_unloading_and_reloading_follow_masings_rule() -> None:
    top = 1.3
    deflection = path(0.0, top, -top, top)
    force = joint_forces(deflection)
    peak = first_loading(np.array([top]))[0]
    down, up = slice(260, 780), slice(780, 1300)
    assert force[down] == pytest.approx(peak - 2 * first_loading((top - deflection[down]) / 2), abs=1e-12)
    assert force[up] == pytest.approx(-peak + 2 * first_loading((deflection[up] + top) / 2), abs=1e-12)


def test_dissipation_per_cycle_is_four_times_slip_force_times_slip_travel() -> None:
    top = 1.3
    deflection = path(0.0, top, -top, top)[259:]
    force = joint_forces(path(0.0, top, -top, top))[259:]
    loop = np.sum(np.diff(deflection) * (force[1:] + force[:-1]) / 2)
    slipping = top > SLIP
    expected = np.sum((4 * STIFFNESS * SLIP * (top - SLIP))[slipping])
    # The trapezoidal rule cuts the corners where an element begins to slip.
    assert loop == pytest.approx(expected, rel=1e-3)


def test_minor_loop_closes_and_is_forgotten() -> None:
    with_loop = joint_forces(path(0.0, 0.8, 0.5, 0.8, 1.3))
    assert with_loop[-100:] == pytest.approx(first_loading(path(0.8, 1.3)), abs=1e-12)


def test_turning_points_between_instants_are_passed_through() -> None:
    """Of a sine the samples miss the peaks; Masing's rule knows them."""
    top, errors = 1.3, {}
    for n in (31, 61):  # a period
        theta = 2.0 * np.pi * np.arange(0.37, 3.0 * n) / n
        deflection, rising = -top * np.cos(theta), np.sin(theta) > 0.0
        force, peak = joint_forces(deflection), first_loading(np.array([top]))[0]
        up, down = (first_loading((top + sign * deflection) / 2.0) for sign in (1.0, -1.0))
        error = np.abs(force - np.where(rising, 2.0 * up - peak, peak - 2.0 * down))
        turned = np.diff(rising, prepend=True)  # the reversal is seen one instant later
        errors[n] = np.max(error[(theta > 4.0 * np.pi) & ~turned])
    assert errors[61] < 3e-4
    assert errors[31] / errors[61] > 1.97**3.5


def test_stuck_joint_adds_nothing_to_the_plant() -> None:
    stuck = ideal().friction[0].model_dump() | {"slip": [1e3] * 6}
    voltages = 2.0 * np.sin(2 * np.pi * 24.4 / 5000 * np.arange(5000))
    with_joint = Simulation(ideal(friction=[stuck])).run(voltages)
    without = Simulation(ideal(friction=())).run(voltages)
    assert with_joint.force_n == pytest.approx(without.force_n, abs=1e-9 * np.max(np.abs(without.force_n)))


def test_slipping_joint_takes_energy_and_a_stuck_one_none() -> None:
    # Nothing else damps: the structure is plucked, the coil is as good as open.
    open_circuit = {"resistance_ohm": 1e9, "suspension_damping_n_s_m": 0.0}
    table = ideal().model_dump()
    structure = table["structure"] | {"damping_ratio": [0.0] * 4}
    stinger = table["stinger"] | {"damping_n_s_m": 0.0}
    kept = {}
    for slip in (1.0, 1e6):
        joint = table["friction"][0] | {"slip": [slip * one for one in table["friction"][0]["slip"]]}
        run = Simulation(ideal(friction=[joint], exciter=open_circuit, structure=structure, stinger=stinger))
        run.state.inputs[4] = 0.2
        displacement_m = run.run(np.zeros(10_000)).displacement_m["drive"]
        kept[slip] = np.max(np.abs(displacement_m[-1000:])) / np.max(np.abs(displacement_m[:1000]))
    assert kept[1e6] == pytest.approx(1.0, abs=0.02)
    assert kept[1.0] < 0.95


def test_joint_state_is_part_of_the_checkpoint() -> None:
    rig, state = ideal().build()
    voltages = 3.0 * np.sin(2 * np.pi * 24.4 / 5000 * np.arange(4000))
    out_v = np.empty((4000, 4))
    run_open_loop(rig, state, voltages[:2000], out_v[:2000])
    assert np.any(state.friction != 0.0)
    copy = RigState(*(array.copy() for array in state))
    again_v = np.empty((2000, 4))
    run_open_loop(rig, state, voltages[2000:], out_v[2000:])
    run_open_loop(rig, copy, voltages[2000:], again_v)
    assert np.array_equal(again_v, out_v[2000:])
