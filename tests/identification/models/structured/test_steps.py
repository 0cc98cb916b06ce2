"""Time steps of structured models: energy, the continuous equation, exact derivatives, far beyond the data."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numba import njit
from scipy.integrate import solve_ivp

from identification import IdentificationError
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.kernels import damping_at, spring_at
from identification.models.structured.laws import Masing, PolynomialDamper, PolynomialSpring
from identification.models.structured.model import workspace_for
from identification.models.structured.nudging import ends_of_steps
from identification.models.structured.parameters import Parameters
from identification.models.structured.steps import end_step, run, take_input, take_step
from tests.identification.models.structured.models import RATE_HZ, beam, multisine
from tests.refused import refused


def spring(system, e, x):
    """Force, slope and potential of an element (J)."""
    return spring_at(x, system.tables.springs[e], system.tables.limits[e])


def energy(system, state):
    n = system.omega.size
    q, v = state[:n], state[n : 2 * n]
    stored = 0.5 * v @ v + 0.5 * np.sum((system.omega * q) ** 2)
    stored += np.sum(0.5 * state[2 * n + 1 : -1] ** 2 / system.tables.sliders[:, 0])
    return stored + sum(spring(system, e, float(phi @ q))[2] for e, phi in enumerate(system.phi))


@pytest.mark.parametrize("rms_n", [1.0, 300.0])
def test_over_every_step_the_energy_changes_by_work_less_damping(rms_n):
    model = beam(support_n_m=0.0)
    system, u = model.system, multisine(rms_n, 1)[:, :400]
    room, ends, state = workspace_for(system), ends_of_steps(u, model.steps), np.zeros(system.size)
    q, v, r = state[:2], state[2:4], state[5:]
    used = []
    for row in range(len(ends) - 1):
        before, x, sliding = energy(system, state), system.phi @ q, r.copy()
        take_input(system, room, ends, row, row + 1, 0.0)
        take_step(system, room, q, v, r)
        work = room.mean @ (system.b @ room.u)
        lost = np.sum(2.0 * system.zeta * system.omega * room.mean**2)
        for e, w in enumerate(system.phi @ room.mean):
            h, tables = system.step_s, system.tables
            lost += damping_at(x[e] + 0.5 * h * w, tables.dampers[e], tables.limits[e, 0])[0] * w**2
            for s in range(tables.first[e], tables.first[e + 1]):
                # friction takes the largest force times the way that the slider slips
                stiffness, strength = tables.sliders[s]
                slipped = max(abs(sliding[s] + stiffness * h * w) - strength, 0.0) / stiffness
                lost += strength * slipped / h
        end_step(system, room, q, v, state)
        assert lost >= 0.0
        used.append(np.abs(system.phi @ q) / system.tables.limits[:, 0])
        size = max(before, energy(system, state), system.step_s * abs(work))
        assert energy(system, state) - before == pytest.approx(system.step_s * (work - lost), abs=1e-9 * size)
    assert (np.max(used) > 1.0) == (rms_n > 100.0)


def smooth(**changes):
    """The beam without its joints."""
    first, second = beam().elements
    return beam(elements=(replace(first, laws=first.laws[:2]), replace(second, laws=second.laws[:1])), **changes)


@njit(cache=True)
def polynomial(coefficients, x):
    """Value of a polynomial, that of the lowest power first."""
    value = 0.0
    for one in coefficients[::-1]:
        value = value * x + one
    return value


@njit(cache=True)
def rates(t, x, step_s, u, numbers):
    """Right-hand side of the equation of motion, written anew, with the support's filter."""
    omega, zeta, b, directions, scales, springs, dampers, (stiffness, largest, corner) = numbers
    q, v = x[:2], x[2:4]
    at = min(int(t / step_s), u.size - 2)
    force = u[at] + (u[at + 1] - u[at]) * (t / step_s - at) - largest * np.tanh(stiffness * x[5] / largest)
    out = np.zeros(6)
    out[:2] = v
    out[2:4] = b * force - 2.0 * zeta * omega * v - omega**2 * q
    for e in range(scales.size):
        z, rate = np.sum(directions[e] * q), np.sum(directions[e] * v)
        of_laws = polynomial(springs[e], z / scales[e]) + polynomial(dampers[e], abs(z / scales[e])) * rate
        out[2:4] -= directions[e] * of_laws
    out[4:] = 2.0 * np.pi * corner * np.array([np.sum(b * q) - x[4], x[4] - x[5]])
    return out


def numbers_of(model):
    """What `rates` are made of: a spring in both elements, a damper in the first."""
    first, second = (element.laws for element in model.elements)
    springs, dampers = np.zeros((2, 6)), np.zeros((2, 3))
    for row, law in zip(springs, (first[0], second[0]), strict=True):
        row[2 : 2 + len(law.coefficients_n)] = law.coefficients_n
    dampers[0, 1:] = first[1].coefficients_n_s_m
    directions = np.array([element.direction for element in model.elements])
    scales = np.array([element.scale_m for element in model.elements])
    support = float(model.support_n_m), float(model.support_largest_n), float(model.support_corner_hz)
    return (
        model.omega,
        model.damping_ratio,
        model.input_shapes[:, 0].copy(),
        directions,
        scales,
        springs,
        dampers,
        support,
    )


@pytest.mark.slow
def test_the_run_tends_to_the_solution_of_the_equation_with_the_square_of_the_step():
    u = multisine(1.0, 2)[:, :300]
    errors = []
    for steps in (4, 8):
        model = smooth(steps=steps)
        ends = ends_of_steps(u, steps)[:, 0]
        times = np.arange(ends.size) / (RATE_HZ * steps)
        # steps no longer than the kinks of the linearly interpolated force are apart
        found = solve_ivp(
            rates,
            (0.0, times[-1]),
            np.zeros(6),
            method="DOP853",
            t_eval=times[:-1:steps],
            rtol=1e-9,
            atol=1e-14,
            max_step=times[1],
            args=(times[1], ends, numbers_of(model)),
        )
        run_of = model.simulate(u)
        difference = run_of.displacement - found.y[:2]
        errors.append(np.linalg.norm(difference) / np.linalg.norm(found.y[:2]))
    assert errors[0] < 4e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_a_linear_mode_has_the_frequency_response_of_the_continuous_equation():
    model = beam(elements=(), support_n_m=0.0, damping_ratio=[0.02, 0.02])
    samples = 4000
    spectrum = np.zeros(samples // 2 + 1, complex)
    lines = np.arange(60, 140, 7)  # 15 to 35 Hz
    spectrum[lines] = np.exp(1j * lines**2)
    period = np.fft.irfft(spectrum, samples)
    outputs = model.simulate(np.tile(period, 3)[None]).outputs[0, -samples:]
    omega = 2.0 * np.pi * lines * RATE_HZ / samples
    receptance = model.input_shapes[:, 0] ** 2 / (
        model.omega**2 - omega[:, None] ** 2 + 2j * model.damping_ratio * model.omega * omega[:, None]
    )
    exact = -(omega**2) * receptance.sum(axis=1) + 0.01
    found = np.fft.rfft(outputs)[lines] / np.fft.rfft(period)[lines]
    np.testing.assert_allclose(found, exact, rtol=4e-3)


def test_outputs_are_accelerations_velocities_and_displacements_with_the_residual():
    model, u = beam(steps=8), multisine(1.0, 3)[:, :500]
    found = model.simulate(u)
    acceleration, velocity, displacement = (
        model.output_shapes[row] @ motion
        for row, motion in enumerate((found.acceleration, found.velocity, found.displacement))
    )
    np.testing.assert_allclose(found.outputs[0], acceleration + 0.01 * u[0])
    np.testing.assert_allclose(found.outputs[1:], [velocity, displacement])
    differences = np.gradient(found.displacement, 1.0 / RATE_HZ, axis=1)[:, 5:-5]
    assert np.linalg.norm(differences[0] - found.velocity[0, 5:-5]) < 0.02 * np.linalg.norm(found.velocity[0])


@pytest.mark.parametrize("force_n", [1.0, 30.0])
def test_derivatives_are_those_of_finite_differences(force_n):
    """Also beyond the reach of the laws."""
    start = beam(steps=2)
    parameters = Parameters(start, (0,), True)
    vector = parameters.vector(start)
    u = multisine(force_n, 4)[:, :150]
    found, exact = parameters.derivatives(parameters.model(vector), u, 20)
    np.testing.assert_allclose(found, parameters.model(vector).simulate(u).outputs[:, 20:].T, rtol=1e-12)
    assert len(parameters.names) == vector.size
    for column, name in enumerate(parameters.names):
        step = 1e-5 * max(abs(vector[column]), 1e-1)
        ends = []
        for sign in (-1.0, 1.0):
            moved = vector.copy()
            moved[column] += sign * step
            model = parameters.model(moved)
            # the slope limit of the second element follows the parameters in steps between evaluations of a fit
            ends.append(_with_limits(model, start, u)[:, 20:].T)
        differences = (ends[1] - ends[0]) / (2.0 * step)
        size = np.linalg.norm(exact[..., column])
        assert np.linalg.norm(differences - exact[..., column]) <= 2e-5 * size + 1e-9, name


@pytest.mark.parametrize("stiffness_n", [0.0, 1e-12, 3e-5, 1e-2])
def test_derivatives_by_a_slider_with_almost_no_stiffness_are_those_of_one_that_slips(stiffness_n):
    """Against forward differences; a fit asks at its lower bound, 1e-12 N, where the number is zero."""
    joint = Masing(stiffness_n=(0.5, stiffness_n, 0.3), slips=(0.02, 0.1, 1.5))
    start = beam(elements=(NonlinearElement(direction=[0.9, -0.1], scale_m=1e-5, laws=(joint,)),), support_n_m=0.0)
    parameters = Parameters(start, (0,), False)
    vector = np.maximum(parameters.vector(start), parameters.bounds(parameters.vector(start))[0])
    u, at = multisine(1.0, 4)[:, :400], parameters.names.index("element 1 masing stiffness_n[1]")
    before, exact = parameters.derivatives(parameters.model(vector), u, 20)
    step = 1e-7 * np.eye(vector.size)[at]
    after = parameters.outputs(parameters.model(vector + step), u, 20)
    differences = (after - before) / step[at]
    assert np.linalg.norm(differences - exact[..., at]) < 2e-4 * np.linalg.norm(exact[..., at])


def test_poles_that_are_not_free_stay_and_leave_the_other_derivatives():
    start, u = beam(), multisine(1.0, 4)[:, :200]
    every, some = Parameters(start, (0,), True), Parameters(start, (0,), True, poles=1)
    kept = [every.names.index(name) for name in some.names]
    assert set(every.names) - set(some.names) == {"frequency 2", "damping 2"}
    np.testing.assert_array_equal(some.vector(start), every.vector(start)[kept])
    moved = some.model(some.vector(start) + 1e-3)
    np.testing.assert_array_equal(moved.frequency_hz[1:], start.frequency_hz[1:])
    np.testing.assert_array_equal(moved.damping_ratio[1:], start.damping_ratio[1:])
    assert np.all(some.bounds(some.vector(start)) == np.array(every.bounds(every.vector(start)))[:, kept])
    exact = every.derivatives(start, u, 20)[1]
    np.testing.assert_array_equal(some.derivatives(start, u, 20)[1], exact[..., kept])


def _with_limits(model, start, u):
    """Outputs of a model that has the slopes beyond the reach of another where that one's are limited."""
    from identification.models.structured.model import outputs_of

    system, limits = model.system, model.system.tables.limits.copy()
    frozen = start.system.tables
    ends = frozen.springs[:, 1, [0, -1]].mean(axis=1) * (frozen.springs.shape[2] - 1) / (2.0 * frozen.limits[:, 0])
    limited = ~np.isclose(ends, frozen.limits[:, 1], rtol=1e-9)
    limits[limited] = frozen.limits[limited]
    system = system._replace(tables=system.tables._replace(limits=limits))
    states = np.zeros((u.shape[1], 3, 2))
    run(system, workspace_for(system), ends_of_steps(u, model.steps), np.zeros(system.size), states)
    return outputs_of(model, u, states)


def test_model_and_vector_are_each_other_s_inverse():
    start = beam()
    parameters = Parameters(start, (0,), True)
    again = parameters.model(parameters.vector(start))
    np.testing.assert_allclose(parameters.vector(again), parameters.vector(start))
    u = multisine(1.0, 5)[:, :100]
    np.testing.assert_allclose(again.simulate(u).outputs, start.simulate(u).outputs)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=6),
    st.floats(-3.0, 3.0),
    st.floats(0.2, 5.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
)
def test_whatever_the_coefficients_the_potential_energy_rises_far_away(springs, across, reach, one, other):
    element = NonlinearElement(
        direction=[1.0, across], scale_m=1e-3, laws=(PolynomialSpring(tuple(springs)),), reach=reach
    )
    system = beam(elements=(element, element)).system
    direction = np.array([one, other]) / max(np.hypot(one, other), 1e-3)

    def potential(far):
        q = far * direction
        return energy(system, np.concatenate([q, np.zeros(4)])) / max(
            far * far * np.sum((system.omega * direction) ** 2), 1e-9
        )

    # half of the linear energy is left; what the polynomials took within their reach grows more slowly
    assert potential(1e6) >= 0.249 * (np.hypot(one, other) > 1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_no_force_of_a_hundred_times_the_range_makes_a_run_unbounded(seed):
    rng = np.random.default_rng(seed)
    model = smooth(support_n_m=0.0)
    samples = 4000
    forces = {
        0: multisine(300.0, seed, samples)[0],
        1: 300.0 * np.sqrt(2.0) * np.sin(2.0 * np.pi * rng.uniform(15.0, 150.0) * np.arange(samples) / RATE_HZ),
        2: 300.0 * np.sign(np.sin(2.0 * np.pi * 25.0 * np.arange(samples) / RATE_HZ)),
    }
    found = model.simulate(forces[seed % 3][None])
    assert np.all(np.isfinite(found.outputs))
    # |b|^2 / (4 D) times the integral of the squared force, docs/explanation/structured-models.md
    slowest = np.min(2.0 * model.damping_ratio * model.omega)
    held = ends_of_steps(forces[seed % 3][None], model.steps)[:-1, 0]
    integral = np.cumsum(held**2)[:: model.steps] / (RATE_HZ * model.steps)
    bound = np.sum(model.input_shapes[:, 0] ** 2) / (4.0 * slowest) * integral
    states = np.vstack([found.displacement, found.velocity, np.zeros((2, samples))]).T
    at = slice(1, None, 7)  # no divisor of a period
    energies = np.array([energy(model.system, state) for state in states[at]])
    assert np.max(found.reach_use) > 3.0
    assert np.all(energies <= bound[at] + 1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"frequency_hz": [25.0, -1.0]},
            {"field": "frequency_hz", "value": [25.0, -1.0], "allowed": "numbers above 0: the model must stay bounded"},
        ),
        (
            {"damping_ratio": [0.01, 0.0]},
            {"field": "damping_ratio", "value": [0.01, 0.0], "allowed": "numbers above 0: the model must stay bounded"},
        ),
        ({"input_shapes": [[1.0]]}, {"says": "shape-7", "field": "input_shapes", "allowed": "(2, 1)"}),
        (
            {"frequency_hz": [25.0, 1000.0]},
            {"field": "frequency_hz", "value": [25.0, 1000.0], "allowed": "below 1000, half of the rate of the steps"},
        ),
        ({"steps": 0}, {"field": "steps", "value": 0, "allowed": "1 or above"}),
        ({"support_n_m": -1.0}, {"field": "support_n_m", "value": -1.0, "allowed": "0 or above"}),
        ({"direct": [[np.nan], [0.0], [0.0]]}, {"says": "value-at-is-nan-2", "field": "direct", "allowed": "finite"}),
    ],
)
def test_a_model_that_cannot_be_is_refused(changes, message):
    with refused(IdentificationError, **message):
        beam(**changes)


def test_an_element_that_would_do_work_is_refused():
    with refused(IdentificationError, "coefficients-is", field="polynomial-damper", allowed="numbers from 0"):
        PolynomialDamper((-1.0,))
    with refused(IdentificationError, "shape-8", field="elements[0].direction", allowed="(2,)"):
        beam(elements=(replace(beam().elements[0], direction=[1.0]),))
    with refused(IdentificationError, "shape-9", field="inputs", allowed="1 rows"):
        beam().simulate(np.zeros((2, 9)))


def test_a_mode_that_stands_for_those_above_the_measured_ones_stays_above_them():
    model = beam(frequency_hz=[25.0, 64.0])
    parameters = Parameters(model, (0,), support=False, measured=1)
    least, _ = parameters.bounds(parameters.vector(model))
    np.testing.assert_allclose(np.exp(least[:2]), [12.5, 40.0])  # an octave, and midway to the measured one
    least, _ = replace(parameters, measured=2).bounds(parameters.vector(model))
    np.testing.assert_allclose(np.exp(least[:2]), [12.5, 32.0])
