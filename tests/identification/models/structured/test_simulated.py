"""Structured models as simulators of experiments, and the range of their training data."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, Experiment, IdentificationError, NonlinearElement, StructuredModel, simulated_run
from identification.models.structured.laws import PolynomialSpring
from tests.refused import refused

SOFT = PolynomialSpring((1.0, 0.5))
MODEL = StructuredModel(
    frequency_hz=[25.0],
    damping_ratio=[0.05],
    input_shapes=[[0.9]],
    output_shapes=[[0.9]],
    direct=[[0.0]],
    elements=(NonlinearElement(direction=[0.9], scale_m=1e-3, laws=(SOFT,)),),
    sample_rate_hz=1000.0,
    inputs=(Channel("force", "force", "N"),),
    outputs=(Channel("drive", "drive", "m"),),
)
FORCE = np.random.default_rng(3).normal(size=(1, 400))


def experiment(force=FORCE, **changes) -> Experiment:
    outputs = MODEL.simulate(force).outputs
    given = {"inputs": force, "outputs": outputs, "sample_rate_hz": 1000.0, "input_channels": MODEL.inputs}
    return Experiment(**(given | {"output_channels": MODEL.outputs} | changes))


def test_a_run_is_compared_with_what_was_measured_and_with_the_range_of_the_training_data():
    trained = MODEL.trained_with([experiment(0.5 * FORCE), experiment()])
    outputs = MODEL.simulate(FORCE).outputs
    largest = np.max(np.abs(outputs)) / 1e-3  # the only mode moves the element as it moves the output
    assert trained.elements[0].largest == pytest.approx(largest, rel=1e-12)
    run = simulated_run(trained, experiment(outputs=1.25 * outputs))
    assert run.error[0] == pytest.approx(0.2)
    assert (run.range_use, run.bounded) == (pytest.approx(1.0), True)
    small = simulated_run(trained, experiment(0.1 * FORCE))
    share = np.max(np.abs(MODEL.simulate(0.1 * FORCE).outputs)) / np.max(np.abs(outputs))
    assert small.range_use == pytest.approx(share)
    assert np.isnan(simulated_run(MODEL, experiment()).range_use)


def test_a_record_that_does_not_begin_at_rest_is_refused():
    with refused(IdentificationError, "experiment-late-does-not-begin-at"):
        simulated_run(MODEL, experiment(name="late", initial_state="estimated"))


def test_a_run_that_overflows_is_not_called_bounded():
    huge = replace(experiment(), inputs=1e308 * np.ones((1, 400)))
    assert simulated_run(MODEL, huge).unbounded_at_s is not None


def test_range_use_leaves_out_the_transient_before_the_samples_that_count():
    period, starting = 400, 40
    force = np.tile(0.05 * FORCE, 3)
    force[:, :starting] = 100.0  # of a first period that does not count
    outputs = MODEL.simulate(force).outputs
    measured = experiment(force, outputs=outputs, period_samples=period, counted_from=2 * period)
    run = MODEL.simulate_experiment(measured)
    counted = np.max(np.abs(run.outputs[:, measured.counted_from :])) / 1e-3
    assert np.max(np.abs(run.outputs)) / 1e-3 > 10.0 * counted
    assert run.reach_use == pytest.approx([counted / MODEL.elements[0].reach], rel=1e-12)
    assert MODEL.trained_with([measured]).elements[0].largest == pytest.approx(counted, rel=1e-12)
