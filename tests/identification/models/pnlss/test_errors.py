from dataclasses import replace

import numpy as np
import pytest

from identification import IdentificationError, estimated_initial_state, pnlss_errors
from tests.identification.models.pnlss.systems import experiment, nonlinear_system
from tests.refused import refused


def test_a_scaled_output_is_wrong_by_just_that_share() -> None:
    system = nonlinear_system(2, 1, 2)
    one = replace(experiment(system, 400), level=0.5)
    off = replace(system, c=system.c * [[1.03], [1.0]], d=system.d * [[1.03], [1.0]], f=system.f * [[1.03], [1.0]])
    errors = pnlss_errors(off, [one, one])
    np.testing.assert_allclose(errors.relative, [[0.03, 0.0], [0.03, 0.0]], atol=1e-12)
    np.testing.assert_allclose(errors.overall, 0.03 / np.sqrt(2.0), rtol=1e-9)
    np.testing.assert_allclose(errors.rms[:, 0], 0.03 * np.sqrt(np.mean(one.outputs[0] ** 2)), rtol=1e-9)
    assert errors.names == ("noise 1", "noise 1")
    assert errors.levels.tolist() == [0.5, 0.5]


def test_only_samples_that_count_are_compared() -> None:
    system = nonlinear_system(2, 1, 1)
    one = experiment(system, 400)
    outputs = np.array(one.outputs)
    outputs[:, :100] += 1.0
    both = [replace(one, outputs=outputs, counted_from=start) for start in (100, 99)]
    errors = pnlss_errors(system, both).relative
    assert errors[0] == 0.0
    assert errors[1] > 0.0


def test_an_unbounded_run_is_counted_and_not_raised() -> None:
    system = nonlinear_system(2, 1, 1)
    one = experiment(system, 400)
    ranged = replace(
        system, state_range=np.max(np.abs(system.simulate(one.inputs).states), axis=1), input_range=np.ones(1)
    )
    errors = pnlss_errors(ranged, [one, replace(one, inputs=200.0 * one.inputs)])
    assert errors.bounded.tolist() == [True, False]
    assert errors.unbounded == 1
    assert errors.relative[1, 0] == errors.overall[1] == errors.range_use[1] == np.inf
    assert errors.range_use[0] == pytest.approx(max(1.0, np.max(np.abs(one.inputs))))


@pytest.mark.parametrize("saturating", [0, 2])
def test_the_initial_state_of_a_run_is_found_from_its_first_samples(saturating: int) -> None:
    system = nonlinear_system(4, 1, 2, saturating=saturating)
    begin = np.array([1.0, -2.0, 0.5, 1.5])
    one = experiment(system, 900, begin=begin)
    np.testing.assert_allclose(estimated_initial_state(system, one, samples=200), begin, atol=1e-5)
    assert pnlss_errors(system, [one]).overall[0] < 1e-5
    assert pnlss_errors(system, [replace(one, initial_state="zero")]).overall[0] > 0.05


def test_a_state_that_no_output_tells_of_stays_small() -> None:
    system = nonlinear_system(2, 1, 1)
    one = replace(experiment(system, 900, begin=np.array([1.0, 1.0]), noise=0.01), counted_from=400)
    assert np.max(np.abs(estimated_initial_state(system, one))) < 10.0


def test_an_estimated_initial_state_does_not_depend_on_the_units_of_the_states_nor_on_their_range() -> None:
    system = nonlinear_system(4, 1, 2, saturating=2)
    begin = np.array([1.0, -2.0, 0.5, 1.5])
    # so few and late samples that they tell little of some states, and what is held back shows
    one = replace(experiment(system, 400, begin=begin, noise=0.05), counted_from=250)
    found = estimated_initial_state(system, one, samples=60)
    units = np.array([1e6, 1e-5, 1.0, 1e-3])
    other = system.scaled(states=units, inputs=np.ones(1), outputs=np.array([1.0, 1e4]))
    in_units = replace(one, outputs=one.outputs * [[1.0], [1e-4]])
    np.testing.assert_allclose(
        estimated_initial_state(other, in_units, samples=60) * units, found, rtol=1e-4, atol=1e-4
    )
    ranged = replace(system, state_range=np.array([10.0, 0.1, 5.0, 1.0]))
    np.testing.assert_array_equal(estimated_initial_state(ranged, one, samples=60), found)


def test_what_cannot_be_compared_is_named() -> None:
    system = nonlinear_system(2, 1, 1)
    one = experiment(system, 100)
    with refused(IdentificationError, "none-given", field="experiments"):
        pnlss_errors(system, [])
    with refused(IdentificationError, "output-is-zero-where-it-counts", where="experiments[0] (noise 1)"):
        pnlss_errors(system, [replace(one, outputs=0.0 * one.outputs)])
    with refused(IdentificationError, "inputs-are-the-model-has-2", where="experiments[0] (noise 1)"):
        pnlss_errors(nonlinear_system(2, 2, 1), [one])
    with refused(IdentificationError, "too-few-for-states", field="samples", value=1):
        estimated_initial_state(system, one, samples=1)
