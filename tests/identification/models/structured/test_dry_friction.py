"""Dry friction in structured models: a number that the step makes one, against events, a closed form and finite differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import bound_of, frequency_response
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.laws import Coulomb, friction
from identification.models.structured.parameters import Parameters
from tests.identification.models.structured.models import RATE_HZ, beam, multisine

OMEGA, ZETA = 50.0 * np.pi, 0.01


def one_mode(friction_n, **changes):
    """One mode of 25 Hz and mass 1 kg on which dry friction acts."""
    numbers = {
        "frequency_hz": [25.0],
        "damping_ratio": [ZETA],
        "input_shapes": [[1.0]],
        "output_shapes": [[1.0], [1.0], [1.0]],
        "direct": np.zeros((3, 1)),
        "elements": (NonlinearElement(direction=[1.0], scale_m=1e-3, laws=(Coulomb(friction_n),)),),
        "support_n_m": 0.0,
    }
    return beam(**(numbers | changes))


def by_events(friction_n, force, times):
    """Displacement of a sliding mass, integrated from one turning point to the next; it sticks while the force is too small."""
    state, at, found = np.zeros(2), 0.0, np.zeros(times.size)
    while at < times[-1]:
        pull = force(at) - OMEGA**2 * state[0]
        if abs(pull) <= friction_n:
            grid = np.linspace(at, min(at + 0.01, times[-1]), 2001)
            free = np.flatnonzero(np.abs(force(grid) - OMEGA**2 * state[0]) > friction_n)
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
                force(t) - 2.0 * ZETA * OMEGA * y[1] - OMEGA**2 * y[0] - sign * friction_n,
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


@pytest.mark.parametrize(("friction_n", "largest"), [(0.3, 2e-3), (1.5, 1e-2)])
def test_a_run_is_that_between_turning_points(friction_n, largest):
    times = np.arange(400) / RATE_HZ

    def force(t):
        return 2.0 * np.sin(2.0 * np.pi * 20.0 * np.asarray(t)) + np.sin(2.0 * np.pi * 30.0 * np.asarray(t))

    exact, errors = by_events(friction_n, force, times), []
    for steps in (2, 8):
        found = one_mode(friction_n, steps=steps).simulate(force(times)[None])
        assert found.unsolved_steps == 0
        errors.append(np.linalg.norm(found.displacement[0] - exact) / np.linalg.norm(exact))
    assert errors[1] < largest
    assert errors[1] < 0.6 * errors[0]


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


def test_derivatives_are_those_of_finite_differences():
    start = one_mode(0.3, steps=2)
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
