"""Runs of a virtual beam whose modes scatter: structured and PNLSS models find every run's shift, and lose little by it."""

from functools import partial

import numpy as np
import pytest

import identification
import rig
from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from simulators import VirtualRig

pytestmark = pytest.mark.slow

SEEDS = range(6)


@pytest.fixture(scope="module")
def tested():
    """Experiments of runs at 2.6 N RMS with 0.1 % scatter, the logarithms of their true frequencies, and the modes."""
    bench = load_bench("magnet-beam")
    options = {**bench.driver.options, "scatter": {"frequency": 0.001}}
    scattering = bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})
    plan = load_plan("magnet-beam/multisine-2").model_copy(update={"realisations": 1})
    experiments = []
    for seed in SEEDS:
        with rig.run(plan.model_copy(update={"phase_seed": seed}), bench=scattering, seed=seed) as run:
            experiments += run.experiments()
    with rig.run("magnet-beam/multisine-1") as run:
        modes = identification.linear_modes(next(iter(run.response_matrices().values())), modes=1)
    virtual = VirtualRig.shipped("magnet-beam", scatter={"frequency": 0.001})
    true = np.log([virtual.realised(seed).linear_modes.frequency_hz[0] for seed in SEEDS])
    return experiments, true, modes


def test_shifts_and_errors_of_a_structured_model(tested):
    experiments, true, modes = tested

    def fit(training, validation):
        return identification.fit_structured(modes, training)

    found, scatter = identification.fit_with_scatter(fit, experiments)
    assert scatter.settled
    np.testing.assert_allclose(scatter.shifts[:, 0], true - true.mean(), atol=4e-5)
    assert found.training_error < 0.004  # 0.002 without scatter
    alone = identification.fit_structured(modes, experiments)
    assert alone.training_error > 10.0 * found.training_error


def test_shifts_and_errors_of_a_pnlss_model(tested):
    experiments, true, _ = tested
    fit = partial(identification.identify_pnlss, states=2, settings=identification.FitSettings(iterations=30))
    found, scatter = identification.fit_with_scatter(fit, experiments[:4], validation=experiments[4:])
    np.testing.assert_allclose(scatter.shifts[:, 0], true - true.mean(), atol=1e-4)
    alone = identification.identify_pnlss(
        experiments[:4], validation=experiments[4:], states=2, settings=identification.FitSettings(iterations=30)
    )
    assert found.training_error < 0.5 * alone.training_error
