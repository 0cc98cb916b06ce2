"""Dry friction in structured models: a number that the step makes one, against events, a closed form and finite differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.right_and_wrong import STRUCTURES
from benchmarks.true_structures import experiment, modes
from identification import bound_of, fit_structured, frequency_response
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.hysteresis import dry_step
from identification.models.structured.laws import Coulomb, Stribeck, friction
from identification.models.structured.parameters import Parameters
from tests.identification.models.structured.models import RATE_HZ, beam, multisine

OMEGA, ZETA = 50.0 * np.pi, 0.01


def one_mode(friction, **changes):
    """One mode of 25 Hz and mass 1 kg on which dry friction acts: a law, or the force of Coulomb's."""
    numbers = {
        "frequency_hz": [25.0],
        "damping_ratio": [ZETA],
        "input_shapes": [[1.0]],
        "output_shapes": [[1.0], [1.0], [1.0]],
        "direct": np.zeros((3, 1)),
        "elements": (
            NonlinearElement(
                direction=[1.0], scale_m=1e-3, laws=(Coulomb(friction) if isinstance(friction, float) else friction,)
            ),
        ),
        "support_n_m": 0.0,
    }
    return beam(**(numbers | changes))


def by_events(friction, force, times):
    """Displacement of a sliding mass, integrated from one turning point to the next; it sticks while the force is too small.

    ``friction``: its size (N) at a speed (m/s), at least 0.
    """
    state, at, found = np.zeros(2), 0.0, np.zeros(times.size)
    while at < times[-1]:
        pull = force(at) - OMEGA**2 * state[0]
        if abs(pull) <= friction(0.0):
            grid = np.linspace(at, min(at + 0.01, times[-1]), 2001)
            free = np.flatnonzero(np.abs(force(grid) - OMEGA**2 * state[0]) > friction(0.0))
            end = grid[free[0]] if free.size else grid[-1]
            found[(times > at) & (times <= end)] = state[0]
            at, state = end, np.array([state[0], 0.0])
            continue
        sign = np.sign(pull)

        def stops(t, y, sign=sign):
            return sign * y[1] + 1e-12

        stops.terminal, stops.direction = True, -1.0
        part = solve_ivp(
            lambda t, y, sign=sign: [
                y[1],
                force(t) - 2.0 * ZETA * OMEGA * y[1] - OMEGA**2 * y[0] - sign * friction(abs(y[1])),
            ],
            (at, times[-1]),
            state,
            method="DOP853",
            rtol=1e-8,
            atol=1e-12,
            events=stops,
            dense_output=True,
        )
        inside = (times > at) & (times <= part.t[-1])
        found[inside] = part.sol(times[inside])[0]
        at, state = float(part.t[-1]), np.array([part.y[0, -1], 0.0])
    return found


def structure_direction(model):
    """Of the first mass, at which friction acts, up to its size."""
    direction = model.output_selector(("root",)) @ model.output_shapes
    return direction / np.linalg.norm(direction)


def stribeck(law, scale_m=1e-3):
    """Its size in N at a speed in m/s, by the formula."""
    return lambda w: law.friction_n * (1.0 + law.rise * np.exp(-((w / (law.speed_per_s * scale_m)) ** 2)))


LAWS = {
    "light": (Coulomb(0.3), lambda w: 0.3, 2e-3),
    "heavy": (Coulomb(1.5), lambda w: 1.5, 1e-2),
    "stribeck": (Stribeck(0.4, 0.8, 40.0), stribeck(Stribeck(0.4, 0.8, 40.0)), 5e-3),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_run_is_that_between_turning_points(name):
    law, size, largest = LAWS[name]
    times = np.arange(400) / RATE_HZ

    def force(t):
        return 2.0 * np.sin(2.0 * np.pi * 20.0 * np.asarray(t)) + np.sin(2.0 * np.pi * 30.0 * np.asarray(t))

    exact, errors = by_events(size, force, times), []
    for steps in (2, 8):
        found = one_mode(law, steps=steps).simulate(force(times)[None])
        assert found.unsolved_steps == 0
        errors.append(np.linalg.norm(found.displacement[0] - exact) / np.linalg.norm(exact))
    assert errors[1] < largest
    assert errors[1] < 0.6 * errors[0]


def test_a_step_in_which_friction_stops_the_structure_ends_at_rest():
    """Without that its velocity would change its sign with every step, and its acceleration be as large as it was before."""
    u = np.concatenate([np.full(10, 40.0), np.zeros(190)])[None]
    found = one_mode(20.0, steps=4).simulate(u)
    stopped = int(np.flatnonzero(np.abs(found.velocity[0]) > 1e-5 * np.max(np.abs(found.velocity)))[-1]) + 1
    assert 12 < stopped < 60
    assert np.max(np.abs(found.acceleration[0, stopped + 1 : 150])) < 1e-6 * np.max(np.abs(found.acceleration))


@pytest.mark.parametrize("to_rest", [-0.3, 0.0, 0.2])
def test_dry_friction_does_no_work_on_the_structure_and_is_no_smaller_for_a_longer_way(to_rest):
    ways = np.linspace(-1.0, 1.0, 401)
    forces = np.array([dry_step(0.5, 0.0, 50.0, way, to_rest)[0] for way in ways])
    assert np.all(forces * ways >= 0.0)
    assert np.all(np.diff(forces) >= 0.0)
    assert np.max(np.abs(forces)) == 0.5


@pytest.mark.slow
@pytest.mark.parametrize("law", [Coulomb(), Stribeck()])
def test_dry_friction_is_found_without_a_place(law):
    """Two masses by Runge and Kutta with events; with the direction of one mode fits ended at 1 to 12 %."""
    structure = STRUCTURES[type(law).__name__]
    runs = [experiment(structure, 1.0, 10 + k) for k in range(2)]
    fit = fit_structured(modes(structure), runs, support=False, laws=(law,))
    (element,) = fit.model.elements
    root = structure_direction(fit.model)
    assert fit.training_error < 1e-2
    assert element.direction / np.linalg.norm(element.direction) == pytest.approx(root, abs=0.02)


def test_what_a_run_does_not_depend_on_is_how_far_a_step_creeps(monkeypatch):
    u, found = multisine(2.0, 3)[:, :1000], []
    for creep in (1e-9, 1e-8, 1e-7):
        monkeypatch.setattr(friction, "_CREEP", creep)
        found.append(one_mode(0.5, steps=8).simulate(u).displacement)
    for other in found[1:]:
        assert np.linalg.norm(other - found[0]) < 1e-4 * np.linalg.norm(found[0])


def test_the_peak_of_a_response_is_that_of_the_closed_form():
    """At resonance the force feeds damper and friction, ``F = c w a + 4 R / pi``."""
    peak = frequency_response(one_mode(0.5), 2.0, band_hz=(22.0, 28.0), largest_range_use=9.0).peak()
    assert peak.frequency_hz == pytest.approx(25.0, rel=1e-4)
    assert peak.amplitude_m == pytest.approx((2.0 - 4.0 * 0.5 / np.pi) / (2.0 * ZETA * OMEGA**2), rel=1e-3)


def test_the_peak_of_a_response_with_stribeck_friction_balances_the_power():
    """At resonance the force feeds damper and friction: ``F a/2 = c w a^2/2 + mean of R(w) |w|`` of the sine."""
    law = Stribeck(0.3, 1.0, 150.0)
    peak = frequency_response(one_mode(law), 2.0, band_hz=(22.0, 28.0), largest_range_use=9.0).peak()
    speed = np.abs(np.cos(np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False)))

    def missing(a):
        w = OMEGA * a * speed
        return 0.5 * 2.0 * OMEGA * a - 0.5 * 2.0 * ZETA * OMEGA * (OMEGA * a) ** 2 - np.mean(stribeck(law)(w) * w)

    assert peak.amplitude_m == pytest.approx(brentq(missing, 1e-3, 1e-2), rel=2e-3)
    assert peak.frequency_hz == pytest.approx(25.0, rel=1e-3)


@pytest.mark.parametrize("law", [Coulomb(0.3), Stribeck(0.2, 0.5, 40.0)])
def test_derivatives_are_those_of_finite_differences(law):
    start = one_mode(law, steps=2)
    parameters = Parameters(start, (0,), False)
    vector, u = parameters.vector(start), multisine(2.0, 4)[:, :200]
    _, exact = parameters.derivatives(start, u, 20)
    for column, name in enumerate(parameters.names):
        change = 1e-7 * np.eye(vector.size)[column]
        more, less = (parameters.model(vector + sign * change).simulate(u).outputs[:, 20:].T for sign in (1.0, -1.0))
        size = np.linalg.norm(exact[..., column])
        assert np.linalg.norm((more - less) / 2e-7 - exact[..., column]) <= 1e-3 * size + 1e-6, name


@pytest.mark.parametrize("force_n", [0.5, 5.0, 500.0])
def test_two_elements_with_dry_friction_are_solved_and_within_the_bound(force_n):
    elements = tuple(
        NonlinearElement(direction=direction, scale_m=1e-3, laws=(Coulomb(friction),))
        for direction, friction in (([0.9, -0.1], 0.4), ([1.4, 0.7], 0.2))
    )
    model = beam(elements=elements, support_n_m=0.0, damping_ratio=[0.03, 0.03])
    u = multisine(force_n, 5, highest_hz=160.0)
    found = model.simulate(u)
    assert found.unsolved_steps == 0
    assert np.max(np.abs(found.outputs[2])) < bound_of(model, float(np.max(np.abs(u)))).output_m[2]
