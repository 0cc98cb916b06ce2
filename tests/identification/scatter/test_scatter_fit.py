"""Fits with scatter: known widths and shared parameters come back, and bands hold fresh runs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from identification import IdentificationError, NonlinearElement, fit_structured
from identification.models.pnlss.fitting.fit import fit_pnlss
from identification.models.structured.laws import PolynomialDamper, PolynomialSpring
from identification.scatter.fit import fit_with_scatter
from identification.scatter.run_scatter import RunScatter
from identification.scatter.shifts import Effect, effects_of, modes_of, shifted
from identification.storage import decode, encode
from tests.identification.models.pnlss.systems import experiment as run_of_system, nonlinear_system
from tests.identification.models.structured.models import beam, linear_modes
from tests.identification.models.structured.test_fit import experiment
from tests.refused import refused

WIDTH, NOISE = 0.001, 0.002
ELEMENT = NonlinearElement(
    direction=[0.9, -0.1], scale_m=1e-3, laws=(PolynomialSpring((0.0, 1.0)), PolynomialDamper((0.4,)))
)
TRUE = beam(elements=(ELEMENT,), support_n_m=0.0)
FREQUENCY = (Effect("frequency", 0),)


def runs(count, first=0, noise=NOISE):
    """Experiments of runs with shifts of the first frequency, and the shifts."""
    shifts = WIDTH * np.random.default_rng(1000 + first).standard_normal(count)
    found = [
        experiment(shifted(TRUE, FREQUENCY, [shift]), seed=first + number, noise=noise)
        for number, shift in enumerate(shifts)
    ]
    return [replace(one, excited_hz=(15.0, 35.0)) for one in found], shifts


def fitted(training, validation=()):
    modes = linear_modes(TRUE, 1)
    return fit_structured(modes, training, laws=(PolynomialSpring((0.0, 0.0)), PolynomialDamper((0.0,))), support=False)


@pytest.mark.parametrize("kind", ["frequency", "damping"])
def test_a_shift_moves_one_pole(kind):
    for model in (TRUE, nonlinear_system(4, 1, 1)):
        before, after = modes_of(model), modes_of(shifted(model, [Effect(kind, 1)], [0.02]))
        zeta = [-poles.real / abs(poles) for poles in (before, after)]
        moved = {"frequency": (np.exp(0.02), 1.0), "damping": (1.0, np.exp(0.02))}[kind]
        np.testing.assert_allclose(abs(after) / abs(before), [1.0, moved[0]], rtol=1e-9)
        np.testing.assert_allclose(zeta[1] / zeta[0], [1.0, moved[1]], rtol=1e-9)


def test_a_gain_multiplies_outputs():
    u = np.random.default_rng(1).standard_normal((1, 50))
    for model in (TRUE, nonlinear_system(4, 1, 1)):
        louder = shifted(model, [Effect("gain")], [0.1])
        np.testing.assert_allclose(louder.simulate(u).outputs, np.exp(0.1) * model.simulate(u).outputs, rtol=1e-9)


@pytest.mark.slow
def test_shifts_of_runs_come_back():
    experiments, shifts = runs(6)
    found, scatter = fit_with_scatter(fitted, experiments[:5], validation=experiments[5:], kinds=("frequency",))
    assert scatter.settled
    assert scatter.runs == tuple(f"run {number}" for number in range(1, 7))
    np.testing.assert_allclose(scatter.shifts[:, 0], shifts - shifts.mean(), atol=0.03 * WIDTH)
    assert found.training_error < 1.1 * NOISE
    middle = np.log(found.model.frequency_hz[0] / TRUE.frequency_hz[0])
    assert middle == pytest.approx(shifts.mean(), abs=0.03 * WIDTH)
    assert scatter.widths[0].low < WIDTH < scatter.widths[0].high
    own = scatter.model_of(found.model, "run 2")
    assert np.log(own.frequency_hz[0] / TRUE.frequency_hz[0]) == pytest.approx(shifts[1], abs=0.05 * WIDTH)
    with refused(IdentificationError, field="run", value="run 9", allowed="run 1, run 2, run 3, run 4, run 5, run 6"):
        scatter.model_of(found.model, "run 9")
    again = decode(RunScatter, *encode(scatter))
    assert (again.effects, again.widths, again.runs) == (scatter.effects, scatter.widths, scatter.runs)
    np.testing.assert_array_equal(again.shifts, scatter.shifts)


def test_what_cannot_be_told_apart_is_said():
    experiments, _ = runs(2)
    with refused(IdentificationError, "one", field="runs", allowed="two at least to tell what changes from run to run"):
        fit_with_scatter(fitted, experiments, runs=["a", "a"])
    with refused(IdentificationError, "are-names", field="runs", allowed="2, one for each experiment"):
        fit_with_scatter(fitted, experiments, runs=["a"])
    with refused(IdentificationError, "are-mass", field="kinds", allowed="frequency, damping, gain"):
        effects_of(TRUE, experiments, ("mass",))
    high = [replace(experiments[0], excited_hz=(60.0, 70.0))]
    with refused(IdentificationError, "the-model-has-modes-at-hz", field="scatter"):
        effects_of(TRUE, high)


@pytest.mark.slow
def test_width_and_shared_parameters_of_many_runs_and_bands_of_fresh_ones():
    experiments, shifts = runs(24)
    found, scatter = fit_with_scatter(fitted, experiments)
    width = scatter.widths[scatter.effects.index(FREQUENCY[0])]
    assert width.width == pytest.approx(np.std(shifts, ddof=1), rel=0.02)
    assert width.width == pytest.approx(WIDTH, rel=0.35)
    middle = np.log(found.model.frequency_hz[0] / TRUE.frequency_hz[0])
    assert abs(middle) < 2.6 * WIDTH / np.sqrt(24.0)
    np.testing.assert_allclose(found.model.damping_ratio[0], TRUE.damping_ratio[0], rtol=0.01)

    fresh, _ = runs(24, first=5000)
    generator, covered = np.random.default_rng(3), 0
    for one in fresh:
        band = scatter.band(found.model, one, draws=60)
        output, sample = generator.integers(3), one.counted_from + generator.integers(one.counted)
        covered += band.low[output, sample] <= one.outputs[output, sample] <= band.high[output, sample]
    assert binom.cdf(covered, 24, 0.93) > 0.05


def test_shifts_of_a_pnlss_model_come_back():
    true = nonlinear_system(2, 1, 2, seed=3)
    shifts = np.array([1.2, -0.7, 0.4, -0.9]) * 0.005
    experiments = [
        run_of_system(shifted(true, FREQUENCY, [shift]), 1500, seed=number) for number, shift in enumerate(shifts)
    ]

    def fit(training, validation=()):
        return fit_pnlss(true, training)

    _, scatter = fit_with_scatter(fit, experiments, kinds=("frequency",))
    np.testing.assert_allclose(scatter.shifts[:, 0], shifts - shifts.mean(), atol=1e-4)
