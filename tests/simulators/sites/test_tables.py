"""Springs and dampers as tables: against closed forms, and against the same laws integrated by scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from simulators.analysis import phase_resonance_backbone
from simulators.layout import Flag
from simulators.plant.kernels import local_forces
from simulators.plant.sites import local_sites
from simulators.simulation import Simulation
from simulators.sites.elements import DampingTable, ForceTable
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.analysis.rigs import DAMPING_RATIO, FREQUENCY_HZ, SHAPE, one_mode
from tests.simulators.sites.test_elements import MASS_KG, free_motion, oscillator

UNEVEN = [-2e-3, -1.1e-3, -4e-4, 0.0, 3e-4, 9e-4, 2e-3]


def force_table(force, nodes=UNEVEN, **more):
    return {"kind": "force-table", "deflection_m": nodes, "force_n": [float(force(z)) for z in nodes]} | more


def damping_table(damping, nodes):
    return {"kind": "damping-table", "deflection_m": nodes, "damping_n_s_m": [float(damping(z)) for z in nodes]}


def cubic(z):
    return (5e3 + (2e6 + 4e9 * z) * z) * z


def forces_of(element, deflections):
    exciter, out = VirtualRig.shipped("magnet-beam").exciter, np.zeros(1)
    sites, found = local_sites([element], exciter), []
    for z in deflections:
        local_forces(sites, np.array([z]), 0, out)
        found.append(element.stiffness_n_m * z - out[0])
    return np.array(found)


def test_a_spline_through_a_few_points_of_a_cubic_is_this_cubic():
    z = np.linspace(-2e-3, 2e-3, 1001)
    element = ForceTable.model_validate({"at": "p"} | force_table(cubic))
    assert element.stiffness_n_m == pytest.approx(5e3, rel=1e-9)
    assert forces_of(element, z) == pytest.approx(cubic(z), abs=1e-9 * cubic(2e-3))


def test_beyond_a_table_the_force_is_a_straight_line_with_the_slope_that_is_given_or_that_of_the_end():
    z = np.array([-5e-3, -3e-3, 3e-3, 5e-3])
    ends, slope = cubic(np.sign(z) * 2e-3), 5e3 + 4e6 * np.sign(z) * 2e-3 + 12e9 * 4e-6
    beyond = z - np.sign(z) * 2e-3
    own = ForceTable.model_validate({"at": "p"} | force_table(cubic))
    assert forces_of(own, z) == pytest.approx(ends + slope * beyond, rel=1e-9)
    given = ForceTable.model_validate({"at": "p"} | force_table(cubic, beyond_n_m=-700.0))
    assert forces_of(given, z) == pytest.approx(ends - 700.0 * beyond, rel=1e-9)


def test_a_spring_as_a_table_moves_a_mass_as_scipy_says():
    def even(z):
        return 2e4 * np.sinh(z / 5e-4) * 5e-4

    rig = oscillator(force_table(even, np.linspace(-1.5e-3, 1.5e-3, 65).tolist()), substeps=8)
    rate_hz, n = rig.converter.sample_rate_hz, 400
    reference = solve_ivp(
        lambda t, y: [y[1], -even(y[0]) / MASS_KG], [0.0, n / rate_hz], [1e-3, 0.0], "DOP853",
        np.arange(n) / rate_hz, rtol=1e-11, atol=1e-15,
    )  # fmt: skip
    assert np.max(np.abs(free_motion(rig, n, 1e-3) - reference.y[0])) < 2e-5 * 1e-3


def test_a_damper_as_a_table_slows_a_mass_as_scipy_says_beside_an_exciter_that_droops():
    stiffness, nodes = MASS_KG * (2.0 * np.pi * 30.0) ** 2, np.linspace(-2e-3, 2e-3, 513)

    def damping(z):
        return 5.0 + 8e6 * z**2 + 3e3 * z

    table = oscillator(damping_table(damping, nodes.tolist()), hz=30.0).model_dump()
    table["exciter"] |= {"droop_per_m2": -1e3, "suspension_cubic_n_m3": 1e6}
    simulation = Simulation(VirtualRig.model_validate(table))
    simulation.state.inputs[0] = 1.5e-3 * MASS_KG**0.5
    found, rate_hz = simulation.run(np.zeros(1000)).displacement_m["mass"], simulation.rig.converter.sample_rate_hz
    reference = solve_ivp(
        lambda t, y: [y[1], -(stiffness * y[0] + damping(y[0]) * y[1]) / MASS_KG], [0.0, 1000 / rate_hz],
        [1.5e-3, 0.0], "DOP853", np.arange(1000) / rate_hz, rtol=1e-11, atol=1e-15,
    )  # fmt: skip
    assert np.max(np.abs(reference.y[0][-200:])) < 0.8e-3  # it has been slowed
    assert np.max(np.abs(found - reference.y[0])) < 1e-4 * 1.5e-3


def test_damping_at_phase_resonance_is_that_of_the_describing_function():
    # c2 z^2 dz/dt takes c2 a^4 w^2/8 x 2 pi/w a cycle: the damping c2 a^2/4.
    c2 = 2e6
    nodes = np.linspace(-2e-3, 2e-3, 513).tolist()
    rig = one_mode(elements=[{"at": "drive"} | damping_table(lambda z: c2 * z**2, nodes)])
    found = phase_resonance_backbone(rig, amplitudes_m=[2e-4, 8e-4], near_hz=FREQUENCY_HZ)
    expected = DAMPING_RATIO + c2 * found.amplitude_m**2 / 4.0 * SHAPE**2 / (4.0 * np.pi * FREQUENCY_HZ)
    assert found.damping_ratio == pytest.approx(expected, rel=2e-3)
    assert expected[1] > 1.2 * DAMPING_RATIO


def test_samples_beyond_a_table_are_flagged():
    rig = oscillator(force_table(lambda z: 5e3 * z))
    assert not np.any(run_from(rig, 1e-3) & Flag.LAW_RANGE)
    assert np.any(run_from(rig, 2.1e-3) & Flag.LAW_RANGE)


def run_from(rig, x_m):
    simulation = Simulation(rig)
    simulation.state.inputs[0] = x_m / rig.shape("mass")[0]
    return simulation.run(np.zeros(20)).flags


@pytest.mark.parametrize(
    ("part", "change", "message"),
    [
        (
            ForceTable,
            {"deflection_m": [0.0, 1.0, 2.0, 3.0, 4.0]},
            {
                "field": "deflection_m",
                "value": "0 to 4",
                "allowed": "rising numbers from below 0 to above 0, with 0 itself",
            },
        ),
        (
            ForceTable,
            {"deflection_m": [-1.0, 1.0, 0.0, 3.0, 4.0]},
            {
                "field": "deflection_m",
                "value": "-1 to 4",
                "allowed": "rising numbers from below 0 to above 0, with 0 itself",
            },
        ),
        (
            ForceTable,
            {"deflection_m": [-1.0, 0.1, 2.0, 3.0, 4.0]},
            {
                "field": "deflection_m",
                "value": "-1 to 4",
                "allowed": "rising numbers from below 0 to above 0, with 0 itself",
            },
        ),
        (ForceTable, {"deflection_m": [-1.0, 0.0, 1.0]}, {"says": "at-least-items", "field": "deflection_m"}),
        (ForceTable, {"force_n": [0.0, 0.0]}, {"field": "force_n", "allowed": "5, one per deflection_m"}),
        (ForceTable, {"force_n": [0.0, 0.0, 0.5, 0.0, 0.0]}, {"says": "force-n-at-deflection-allowed-is"}),
        (DampingTable, {"damping_n_s_m": [0.0] * 4}, {"field": "damping_n_s_m", "allowed": "5, one per deflection_m"}),
        (DampingTable, {"damping_n_s_m": [0.0, 1.0, -1.0, 0.0, 0.0]}, {"field": "damping_n_s_m.2", "value": -1.0}),
    ],
)
def test_a_table_that_cannot_be_is_refused(part, change, message):
    name = "force_n" if part is ForceTable else "damping_n_s_m"
    kind = part.model_fields["kind"].annotation.__args__[0]
    table = {"kind": kind, "at": "p", "deflection_m": [-2.0, -1.0, 0.0, 1.0, 2.0], name: [0.0] * 5}
    part.model_validate(table)
    with refused(ValueError, **message):
        part.model_validate(table | change)


def test_a_table_too_steep_for_the_step_is_refused():
    with refused(ValueError, field="elements[0]", allowed="up to 5000, or converter.substeps of at least 801"):
        oscillator(damping_table(lambda z: 1e6, UNEVEN))
    with refused(ValueError, field="elements[0]", allowed="up to 5e+07, or a higher sample rate"):
        oscillator(force_table(lambda z: 1e18 * z**3))
