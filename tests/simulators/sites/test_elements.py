import ctypes
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from simulators.exciter import Exciter
from simulators.plant.kernels import local_forces
from simulators.plant.sites import local_sites
from simulators.simulation import Simulation
from simulators.sites.elements import Clearance, Cubic, Element, Magnet, User
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.references import ideal
from vibrolock.content_cache import c_function

MASS_KG = 0.5
SIGNATURE = "float64(float64, CPointer(float64))"


@c_function(SIGNATURE)
def cubic_of_a_user(z: float, parameters: Any) -> float:
    return -parameters[0] * z * z * z


@c_function(SIGNATURE)
def drag(velocity: float, parameters: Any) -> float:
    return -parameters[0] * velocity * abs(velocity)


@c_function("float64(float64)")
def of_one_argument(z: float) -> float:
    return z


@c_function(SIGNATURE)
def pushing_at_rest(z: float, parameters: Any) -> float:
    return 1.0 - z


@c_function(SIGNATURE)
def undefined_at_rest(z: float, parameters: Any) -> float:
    return float(np.sqrt(z - 1.0))


NAME = f"{__name__}:cubic_of_a_user"


def oscillator(element: dict[str, Any], *, hz: float = 0.0, substeps: int = 4) -> VirtualRig:
    """One mass with an element to the ground; the exciter beside it hangs on a stinger that is as good as absent."""
    shapes = {"mass": [MASS_KG**-0.5]}
    table = ideal(friction=(), elements=(), converter={"substeps": substeps}).model_dump() | {
        "specimen": None,
        "structure": {"kind": "modal", "frequency_hz": [hz], "damping_ratio": [0.0], "shapes": shapes},
        "elements": [{"at": "mass"} | element],
        "stinger": {"at": "mass", "stiffness_n_m": 1e-12, "damping_n_s_m": 0.0},
        "sensors": [{"name": "force", "kind": "force", "sensitivity_v_per_unit": 1.0, "range_v": 1e9}],
    }
    return VirtualRig.model_validate(table)


def free_motion(rig: VirtualRig, n: int, x_m: float = 0.0, v_m_s: float = 0.0) -> np.ndarray:
    simulation = Simulation(rig)
    scale = rig.shape("mass")[0]
    simulation.state.inputs[0], simulation.state.inputs[1] = x_m / scale, v_m_s / scale
    n_state = rig.plant.dynamics.shape[0]
    forces = np.zeros(1)
    local_forces(simulation.arrays.sites, rig.plant.site_rows @ simulation.state.inputs[:n_state], 0, forces)
    simulation.state.inputs[n_state + 1] = forces[0]
    return simulation.run(np.zeros(n)).displacement_m["mass"]


def test_cubic_spring_follows_duffings_elliptic_solution() -> None:
    # x'' + a x + b x^3 = 0 from x0 at rest: x = x0 cn(w t, m), w^2 = a + b x0^2, m = b x0^2 / (2 w^2).
    linear, cubic, x0 = MASS_KG * (2 * np.pi * 20.0) ** 2, 4e9, 1e-3
    rig = oscillator({"kind": "cubic", "linear_n_m": linear, "stiffness_n_m3": cubic})
    a, b = linear / MASS_KG, cubic / MASS_KG
    w = np.sqrt(a + b * x0**2)
    m = b * x0**2 / (2 * w**2)
    x = free_motion(rig, 2000, x_m=x0)
    expected = x0 * ellipj(w * np.arange(2000) / 5000, m)[1]
    assert 4 * ellipk(m) / w < 0.9 / 20.0  # well away from the linear period
    assert np.max(np.abs(x - expected)) < 2e-3 * x0


def test_quadratic_spring_is_that_of_its_potential() -> None:
    linear, quadratic, x0 = 8e3, 4e6, 4e-4
    rig = oscillator({"kind": "cubic", "linear_n_m": linear, "quadratic_n_m2": quadratic, "stiffness_n_m3": 0.0})
    x = free_motion(rig, 2000, x_m=x0)
    other = np.roots([quadratic / 3, linear / 2, 0.0, -(quadratic * x0**3 / 3 + linear * x0**2 / 2)])
    turning = max(root.real for root in other if abs(root.imag) < 1e-12 and root.real < 0)
    assert x.min() == pytest.approx(turning, rel=2e-3)
    assert x.max() == pytest.approx(x0, rel=2e-3)


def bouncing(t: np.ndarray, gap: float, other_gap: float, k: float, v: float) -> np.ndarray:
    """A free mass between two stops, piecewise: straight flight, half a sine in a stop, straight back."""
    w = np.sqrt(k / MASS_KG)
    contact, flight = np.pi / w, (gap + other_gap) / v
    since = np.mod(t + other_gap / v, 2 * (contact + flight))
    x = np.empty_like(t)
    for first, sign, g in ((0.0, 1.0, gap), (flight + contact, -1.0, other_gap)):
        from_stop = sign * (-other_gap if sign > 0 else gap)
        flying = (since >= first) & (since < first + flight)
        x[flying] = sign * (from_stop + v * (since[flying] - first))
        touching = (since >= first + flight) & (since < first + flight + contact)
        x[touching] = sign * (g + v / w * np.sin(w * (since[touching] - first - flight)))
    return x


def test_clearance_on_both_sides_follows_the_piecewise_linear_solution() -> None:
    k, gap, other, v = 2e5, 1e-3, 0.6e-3, 0.3
    errors = {}
    for substeps in (4, 16):
        clearance = {"kind": "clearance", "gap_m": gap, "other_gap_m": other, "contact_stiffness_n_m": k}
        x = free_motion(oscillator(clearance, substeps=substeps), 300, v_m_s=v)
        expected = bouncing(np.arange(300) / 5000, gap, other, k, v)
        assert x.max() > gap
        assert x.min() < -other
        errors[substeps] = np.max(np.abs(x - expected)) / gap
    assert errors[4] < 2e-2
    assert errors[16] < 0.2 * errors[4]


def test_one_sided_clearance_leaves_the_other_side_free() -> None:
    k, gap, v = 2e5, 1e-3, 0.3
    x = free_motion(
        oscillator({"kind": "clearance", "gap_m": gap, "contact_stiffness_n_m": k}, substeps=16), 300, v_m_s=v
    )
    out = gap / v + np.pi / np.sqrt(k / MASS_KG)
    t = np.arange(300) / 5000
    back = t > out
    assert x[back] == pytest.approx(gap - v * (t[back] - out), abs=1e-2 * gap)


def test_a_users_function_gives_the_samples_of_the_same_law_built_in() -> None:
    voltages = 3.0 * np.sin(2 * np.pi * 24.0 / 5000 * np.arange(3000))
    built_in = {"kind": "cubic", "at": "magnet", "stiffness_n_m3": 1e7}
    expected = Simulation(ideal(elements=[built_in])).run(voltages).force_n
    linear = Simulation(ideal(elements=())).run(voltages).force_n
    assert np.max(np.abs(expected - linear)) > 0.1
    for function in (NAME, cubic_of_a_user, cubic_of_a_user.ctypes):
        user = {"kind": "user", "at": "magnet", "function": function, "parameters": [1e7]}
        assert np.array_equal(Simulation(ideal(elements=[user])).run(voltages).force_n, expected)


def test_a_users_element_survives_writing_and_reading() -> None:
    rig = ideal(elements=[{"kind": "user", "at": "magnet", "function": cubic_of_a_user, "parameters": [1e7]}])
    again = VirtualRig.model_validate_json(rig.model_dump_json())
    assert again.elements[0].model_dump()["function"] == NAME
    assert again.build()[0].sites["address"] == rig.build()[0].sites["address"]


def test_an_element_of_velocity_slows_a_free_mass_as_drag_does() -> None:
    # m v' = -c v |v|: v = v0 / (1 + c v0 t / m).
    c, v0 = 3.0, 2.0
    rig = oscillator({"kind": "user", "function": drag, "parameters": [c], "of": "velocity"})
    x = free_motion(rig, 2500, v_m_s=v0)
    expected = MASS_KG / c * np.log1p(c * v0 / MASS_KG * np.arange(2500) / 5000)
    assert x == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_declared_linear_part_changes_the_split_and_not_the_law() -> None:
    x0 = 1e-3
    split = [
        free_motion(
            oscillator(
                {"kind": "user", "function": cubic_of_a_user, "parameters": [4e9], "linear_n_m": k},
                hz=20.0,
                substeps=32,
            ),
            500,
            x_m=x0,
        )
        for k in (0.0, 2e3)
    ]
    assert split[0] == pytest.approx(split[1], abs=1e-4 * x0)
    assert not np.array_equal(split[0], split[1])


def test_element_between_two_points_pulls_both() -> None:
    # Two free masses and a linear spring between them: the relative motion has the frequency of the reduced mass.
    masses, k = (0.5, 0.2), 3e3
    shapes = {"mass": [masses[0] ** -0.5, 0.0], "other": [0.0, masses[1] ** -0.5]}
    spring = {"kind": "cubic", "at": "mass", "to": "other", "linear_n_m": k, "stiffness_n_m3": 0.0}
    structure = {"kind": "modal", "frequency_hz": [0.0, 0.0], "damping_ratio": [0.0, 0.0], "shapes": shapes}
    table = oscillator({"kind": "cubic", "stiffness_n_m3": 0.0}).model_dump()
    rig = VirtualRig.model_validate(table | {"structure": structure, "elements": [spring]})
    reduced = masses[0] * masses[1] / sum(masses)
    assert rig.linear_modes.frequency_hz[1] == pytest.approx(np.sqrt(k / reduced) / (2 * np.pi), rel=1e-9)
    stiff = VirtualRig.model_validate(table | {"structure": structure, "elements": [spring | {"stiffness_n_m3": 1e12}]})
    simulation = Simulation(stiff)
    simulation.state.inputs[2:4] = 0.4 * masses[0] ** 0.5, -1.0 * masses[1] ** 0.5  # equal and opposite momenta
    moved = simulation.run(np.zeros(2000)).displacement_m
    total = masses[0] * moved["mass"] + masses[1] * moved["other"]
    assert np.max(np.abs(total)) < 1e-9 * masses[0] * np.max(np.abs(moved["mass"])) + 1e-12
    assert np.max(np.abs(moved["mass"])) > 1e-5


ELEMENTS: list[Element] = [
    Magnet(kind="magnet-one-sided", at="p", strength_n_m4=1e-7, gap_m=0.01),
    Magnet(kind="magnet-symmetric", at="p", strength_n_m4=1e-7, gap_m=0.01),
    Cubic(kind="cubic", at="p", stiffness_n_m3=1e9, quadratic_n_m2=3e5, linear_n_m=50.0),
    Clearance(kind="clearance", at="p", gap_m=1e-3, contact_stiffness_n_m=1e4),
    User(kind="user", at="p", function=cubic_of_a_user, parameters=(1e9,), linear_n_m=50.0),
]


@pytest.mark.parametrize("element", ELEMENTS[:2], ids=lambda element: element.kind)
def test_beyond_its_limit_the_force_of_a_magnet_goes_on_along_its_tangent(element: Magnet) -> None:
    strength, gap, limit = element.strength_n_m4, element.gap_m, element.limit_m
    sites, force = local_sites([element], VirtualRig.shipped("magnet-beam").exciter), np.zeros(1)
    for z in np.array([-1.5, -1.0, -0.5, 0.5, 1.0, 1.5]) * limit:
        held = np.clip(z, -limit, limit)
        far = gap if element.one_sided else gap + held
        law = strength * (far**-4.0 - (gap - held) ** -4.0)
        tangent = -4.0 * strength * ((gap - held) ** -5.0 + (0.0 if element.one_sided else far**-5.0))
        local_forces(sites, np.array([z]), 0, force)
        assert force[0] - element.stiffness_n_m * z == pytest.approx(law + tangent * (z - held), rel=1e-9)


@pytest.mark.parametrize("element", ELEMENTS, ids=lambda element: element.kind)
def test_site_force_has_no_slope_at_rest_but_what_was_declared(element: Element) -> None:
    exciter = VirtualRig.shipped("magnet-beam").exciter
    sites, forces = local_sites([element], exciter), np.zeros(1)
    slope = []
    for z in (-1e-7, 1e-7):
        local_forces(sites, np.array([z]), 0, forces)
        slope.append(forces[0] / z)
    declared = element.linear_n_m if isinstance(element, User) else 0.0
    assert np.mean(slope) == pytest.approx(declared, abs=1e-3 * max(element.stiffness_n_m, 1.0))


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (
            {"function": "nothing_here:spring"},
            {"field": "function", "value": "nothing_here:spring", "allowed": "a function that can be imported"},
        ),
        ({"function": f"{__name__}:no_such_name"}, {"field": "function", "allowed": "a function that can be imported"}),
        ({"function": "spring"}, {"field": "function", "value": "spring", "allowed": "'module:name'"}),
        ({"function": "math:sin"}, {"says": "is-a-builtin-function-or-method", "field": "function = 'math:sin'"}),
        (
            {"function": of_one_argument},
            {
                "says": "is-c-double-c-double-allowed",
                "field": "function = 'tests.simulators.sites.test_elements:of_one_argument'",
            },
        ),
        ({"function": ctypes.CDLL(None).labs}, {"says": "is-c-int-allowed-is", "field": "function = 'ctypes:labs'"}),
        ({"function": pushing_at_rest}, {"field": "function", "allowed": "0: z counts from equilibrium"}),
        ({"function": undefined_at_rest}, {"field": "function", "allowed": "a finite force"}),
        ({"function": NAME, "parameters": [1.0] * 9}, {"says": "at-most-items", "field": "parameters"}),
        (
            {"function": drag, "of": "velocity", "linear_n_m": 1.0},
            {"field": "linear_n_m", "value": 1.0, "allowed": "0 where the element is of velocity"},
        ),
    ],
)
def test_a_users_function_that_cannot_work_is_refused(element: dict[str, Any], message: dict[str, object]) -> None:
    with refused(ValueError, **message):
        User.model_validate({"kind": "user", "at": "magnet"} | element)


@pytest.mark.slow
def test_a_users_function_needs_no_compilation_of_the_plant_in_another_process(tmp_path: Path) -> None:
    (tmp_path / "my_springs.py").write_text(
        "import numba\n@numba.cfunc('float64(float64, CPointer(float64))')\ndef spring(z, p):\n    return -p[0] * z**3\n"
    )
    script = (
        "from simulators.stepping import run_observed\nfrom simulators.simulation import Simulation\n"
        "from simulators.virtual_rig import VirtualRig\n"
        "user = {'kind': 'user', 'at': 'tip', 'function': 'my_springs:spring', 'parameters': [1e6]}\n"
        "print(Simulation(VirtualRig.shipped('magnet-beam', elements=[user])).run([5.0] * 100).force_n[-1])\n"
        "print(sum(run_observed.stats.cache_misses.values()))\n"
    )
    Simulation(ideal()).run([0.0])  # whatever is to be compiled is in the cache now
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    misses = []
    for _ in range(3):  # tests beside this one write to the same cache, and one may undo what another has just written
        lines = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        assert abs(float(lines[0])) > 0.1
        misses.append(lines[1])
    assert "0" in misses


def test_exciter_that_is_linear_adds_no_sites() -> None:
    exciter = Exciter.model_validate(VirtualRig.shipped("magnet-beam").exciter.model_dump())
    assert local_sites([], exciter).size == 0
