from dataclasses import replace

import numpy as np
import pytest

from identification import Experiment, PnlssModel
from identification.models.pnlss.features import FUNCTIONS
from identification.models.pnlss.fitting.blocks import Blocks, Derivatives
from identification.models.pnlss.fitting.frequency_lines import with_lines
from identification.models.pnlss.fitting.normal_equations import normal_equations
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.records import Record, records_of, simulated
from identification.models.pnlss.fitting.result import FitSettings
from tests.identification.models.pnlss.systems import experiment, nonlinear_system, periodic_experiment
from vibrolock.arrays import Float


def jacobian(parameters: Parameters, vector: Float, record: Record, weights: Float) -> Float:
    """float[n_outputs, counted, n_parameters]: full Jacobian of one experiment in time, for small problems and checks."""
    system, begins = parameters.system(vector), parameters.initial_states(vector)
    n, own = len(system.state), system.output.shape[1]
    x, at = np.zeros(n) if record.place is None else begins[record.place], 0
    onto = parameters.onto(parameters.begin_derivatives(record.place))
    whole = np.zeros((len(weights), len(record.u) - record.counted_from, parameters.count))
    of: Derivatives = "parameters" if record.place is None else "all"
    blocks = Blocks(system, record, weights, x, (0, len(record.u)), of)
    for _ in blocks:
        part = whole[:, at : at + len(blocks.rows)]
        at += len(blocks.rows)
        part[:, :, : parameters.shared] = np.moveaxis(blocks.rows[:, n:] @ onto[:, :-1], 1, 0)
        for output, by in enumerate(weights):
            part[output, :, parameters.own(output)] = by * blocks.q[:, :own]
    return whole


def record(system: PnlssModel, one: Experiment) -> Record:
    return records_of([one], np.ones(len(system.inputs)), np.ones(len(system.outputs)))[0]


def differences(parameters: Parameters, vector: Float, one: Record, weights: Float, size: float = 1e-4) -> Float:
    """float[n_outputs, counted, n_parameters], fourth order."""

    def outputs(at: Float) -> Float:
        begins = parameters.initial_states(at)
        run = simulated(parameters.system(at), one.u, begins[0] if len(begins) else np.zeros(parameters.start.states))
        assert run is not None
        return np.asarray((weights * run[1])[one.counted_from :].T)

    columns = []
    for index, value in enumerate(vector):
        step = np.zeros_like(vector)
        step[index] = size * max(1.0, abs(value))
        first, second = (outputs(vector + times * step) - outputs(vector - times * step) for times in (1, 2))
        columns.append((8.0 * first - second) / (12.0 * step[index]))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize(("states", "inputs", "outputs"), [(2, 1, 1), (3, 1, 4), (2, 2, 2)])
@pytest.mark.parametrize("estimated", [False, True])
def test_the_jacobian_is_that_of_finite_differences(
    states: int, inputs: int, outputs: int, estimated: bool, function: str
) -> None:
    system = nonlinear_system(states, inputs, outputs, saturating=2, function=function)
    begin = np.linspace(0.2, 0.5, states) if estimated else None
    one = record(system, replace(experiment(system, 120, begin=begin, noise=0.1), counted_from=20))
    parameters = Parameters(system, int(estimated))
    begins = np.full((int(estimated), states), 0.3)
    vector, weights = parameters.vector(system, begins), np.linspace(1.0, 2.0, outputs)
    mine, theirs = jacobian(parameters, vector, one, weights), differences(parameters, vector, one, weights)
    size = np.max(np.abs(theirs), axis=(0, 1))
    assert np.all(size > 0.0)
    assert np.max(np.abs(mine - theirs) / size) < 1e-7


def test_variables_that_are_held_at_their_limits_have_no_part_in_derivatives() -> None:
    system = nonlinear_system(2, 1, 2)
    free = experiment(system, 150, noise=0.1)
    largest = np.max(np.abs(system.simulate(free.inputs).states), axis=1)
    held = replace(system, state_range=0.5 * largest, input_range=np.array([0.4])).bounded()
    assert np.max(np.abs(held.simulate(free.inputs).outputs - system.simulate(free.inputs).outputs)) > 1e-3
    one, parameters = record(system, free), Parameters(held)
    vector = parameters.vector(held, np.zeros((0, 2)))
    mine = jacobian(parameters, vector, one, np.ones(2))
    theirs = differences(parameters, vector, one, np.ones(2), size=1e-6)  # so small that no run crosses a limit
    assert np.max(np.abs(mine - theirs)) < 1e-6 * np.max(np.abs(theirs))


def test_normal_equations_are_products_of_the_jacobian_whatever_the_block() -> None:
    system = nonlinear_system(2, 1, 3, saturating=1)
    experiments = [
        experiment(system, 700, noise=0.1),
        experiment(system, 1300, seed=2, noise=0.1, begin=np.array([0.3, -0.2])).weighted(4.0),
    ]
    records = records_of(experiments, np.ones(1), np.ones(3))
    parameters, weights = Parameters(system, 1), np.array([1.0, 2.0, 0.5])
    vector = parameters.vector(system, np.array([[0.1, 0.1]]))
    found = normal_equations(parameters, vector, records, weights)
    hessian, gradient = np.zeros_like(found.hessian), np.zeros_like(found.gradient)
    for one, begin in zip(records, (np.zeros(2), np.array([0.1, 0.1])), strict=True):
        rows = jacobian(parameters, vector, one, weights).reshape(-1, parameters.count)
        run = simulated(parameters.system(vector), one.u, begin)
        assert run is not None
        hessian += one.weight * rows.T @ rows
        gradient += one.weight * rows.T @ (weights * (run[1] - one.y)).T.ravel()
    np.testing.assert_allclose(found.hessian, hessian, rtol=0.0, atol=1e-12 * np.max(np.abs(hessian)))
    np.testing.assert_allclose(found.gradient, gradient, rtol=0.0, atol=1e-12 * np.max(np.abs(gradient)))


def test_lines_of_all_frequencies_make_the_same_normal_equations_as_samples() -> None:
    system = nonlinear_system(2, 1, 2)
    weights, rate_hz = np.array([1.0, 0.5]), system.sample_rate_hz
    records = records_of([periodic_experiment(system, 601)], np.ones(1), np.ones(2))
    parameters = Parameters(system)
    vector = 1.001 * parameters.vector(system, np.zeros((0, 2)))
    by_lines = with_lines(records, FitSettings(band_hz=(0.0, rate_hz)), rate_hz)
    in_time, in_lines = (normal_equations(parameters, vector, r, weights) for r in (records, by_lines))
    np.testing.assert_allclose(in_lines.hessian, in_time.hessian, rtol=0.0, atol=1e-8 * np.max(in_time.hessian))
    size = np.max(np.abs(in_time.gradient))
    np.testing.assert_allclose(in_lines.gradient, in_time.gradient, rtol=0.0, atol=1e-8 * size)
    np.testing.assert_allclose(by_lines[0].squares(records[0].y), records[0].squares(records[0].y), rtol=1e-8)


def test_line_weights_count_by_output_and_frequency() -> None:
    system = nonlinear_system(2, 1, 2)
    rate_hz = system.sample_rate_hz
    records = records_of([periodic_experiment(system, 600)], np.ones(1), np.ones(2))
    rows = ((0.0, 2.0, 0.0), (20.0, 2.0, 1.0))
    (one,) = with_lines(records, FitSettings(line_weights=rows), rate_hz)
    spectra = np.fft.rfft(records[0].y[-600:], axis=0).T
    frequencies_hz = np.fft.rfftfreq(600, 1.0 / rate_hz)
    inside = (frequencies_hz > 0.0) & (frequencies_hz <= 20.0)
    ramps = np.stack([np.full(frequencies_hz.size, 2.0), frequencies_hz / 20.0])
    by_hand = 2.0 * 2.0 / 600.0 * np.sum(np.abs(ramps * spectra)[:, inside] ** 2, axis=1)  # two periods, both sides
    by_hand += [2.0 / 600.0 * np.abs(2.0 * spectra[0, 0]) ** 2, 0.0]
    np.testing.assert_allclose(one.squares(records[0].y), by_hand, rtol=1e-6)


def test_a_run_that_leaves_all_bounds_gives_no_finite_equations() -> None:
    system = nonlinear_system(2, 1, 1)
    records = records_of([experiment(system, 800)], np.ones(1), np.ones(1))
    wild = replace(system, e=50.0 + system.e)
    found = normal_equations(Parameters(wild), Parameters(wild).vector(wild, np.zeros((0, 2))), records, np.ones(1))
    assert not np.all(np.isfinite(found.hessian))
