"""From experiments to a model in one call, against systems that are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Features,
    FitProgress,
    FitSettings,
    IdentificationError,
    PnlssModel,
    StateSpace,
    best_linear_responses,
    identify_pnlss,
    linear_pnlss,
    pnlss_errors,
)
from identification.linear.state_space_fit import spectral_radius
from identification.models.pnlss import compared_starts, identify, linear_model as linear_model_module
from identification.models.pnlss.fitting import checks
from identification.models.pnlss.linear_model import linear_start, reflected
from tests.identification.models.pnlss.multisines import (
    RATE_HZ,
    channels,
    linear_model,
    measured,
    multisine,
    oscillator,
)
from tests.refused import refused


def hardening(outputs: int = 1) -> PnlssModel:
    """The oscillator with quadratic and cubic terms, which change its response by a third at an input of RMS one."""
    linear = linear_model(oscillator(outputs=outputs))
    model = linear.with_features(Features.monomials(2, 1, (2, 3), of=(0, 1)), Features.monomials(2, 1, (2,), of=(0,)))
    e, f = np.array(model.e), np.array(model.f)
    e[1, 0], e[1, 3], e[0, 3], f[0, 0] = 0.01, 0.01, -0.003, 0.02
    return replace(model, e=e, f=f)


def test_a_known_nonlinear_system_is_found_down_to_the_noise_in_one_call() -> None:
    exact = hardening(outputs=2)
    noise = 1e-3
    training = [measured(exact, multisine(seed), noise=noise, seed=seed) for seed in range(2)]
    found = identify_pnlss(training, states=2, validation=[measured(exact, multisine(8), noise=noise, seed=8)])
    test = measured(exact, multisine(9))
    linear, nonlinear = (pnlss_errors(m, [test]).overall[0] for m in (found.linear, found.model))
    assert linear > 0.1
    # 84 parameters of 4096 values: what noise leaves is a seventh of it.
    assert nonlinear < 0.5 * noise
    assert 0.7 * noise < found.training_error < 1.3 * noise
    scores = {note.split(":")[0]: note for note in found.model.notes if "training error" in note}
    assert list(scores) == ["linear model", "nonlinear model"]
    pooled = [measured(exact, multisine(seed), noise=noise, seed=seed) for seed in range(2)]
    runs = [found.linear.simulate(e.inputs).outputs[:, e.counted_from :] for e in pooled]
    misfit = np.hstack([run - e.counted_outputs for run, e in zip(runs, pooled, strict=True)])
    size = np.hstack([e.counted_outputs for e in pooled])
    error = np.sqrt(np.mean(np.sum(misfit**2, axis=1) / np.sum(size**2, axis=1)))
    assert f"training error {100 * error:.2g} %" in scores["linear model"]
    assert not any("unstable" in note for note in found.model.notes)


def test_a_fit_is_not_lost_to_the_notes_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = hardening(outputs=2)
    one, other = (measured(exact, multisine(seed)) for seed in range(2))
    without = replace(other, outputs=other.outputs * [[1.0], [0.0]])
    found = identify_pnlss([one, without], states=2, settings=FitSettings(iterations=1))
    assert any("linear model: training error" in note for note in found.model.notes)
    real = identify.fit_pnlss

    def refusing(start: PnlssModel, *args: object, **kwargs: object) -> object:
        if not start.state_features.count:
            raise IdentificationError("no")
        return real(start, *args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr(identify, "fit_pnlss", refusing)
    found = identify_pnlss([one], states=2, settings=FitSettings(iterations=1))
    assert "linear model: no training error (no)" in found.model.notes
    assert found.history.iterations == 1


def test_an_unstable_linear_part_is_noted_with_its_frequency_and_growth() -> None:
    stable = linear_model(oscillator(frequency_hz=60.0))
    assert identify._unstable(stable) == []
    growing = replace(stable, a=stable.a * 1.01 / spectral_radius(stable.a))
    (note,) = identify._unstable(growing)
    assert "unstable: at 59.97 Hz" in note  # 60 Hz with 3 % damping
    assert "rate of 7.96 1/s" in note  # 800 Hz times log 1.01


@pytest.mark.slow
def test_saturating_features_find_a_saturating_system() -> None:
    linear = linear_model(oscillator())
    weights = np.array([[0.6, 0.2, 0.0, 0.3]])
    exact = replace(linear.with_features(Features.saturating(weights)), e=np.array([[-0.1], [-0.05]]))
    training = [measured(exact, multisine(seed)) for seed in range(2)]
    found = identify_pnlss(training, states=2, saturating=(3, 0), settings=FitSettings(iterations=40))
    test = pnlss_errors(found.model, [measured(exact, multisine(9))])
    assert pnlss_errors(found.linear, [measured(exact, multisine(9))]).overall[0] > 0.03
    assert test.overall[0] < 1e-3
    assert found.model.state_features.weights.shape == (3, 4)
    assert found.model.output_features.count == 0


def stopped_after(iterations: int, seen: list[FitProgress]) -> Callable[[FitProgress], None]:
    def progress(at: FitProgress) -> None:
        seen.append(at)
        if len(seen) == iterations:
            raise KeyboardInterrupt

    return progress


def test_starts_are_told_of_while_they_are_compared() -> None:
    seen: list[FitProgress] = []
    identify_pnlss(
        [measured(hardening(), multisine(0))],
        states=2,
        saturating=2,
        settings=FitSettings(iterations=61, tolerance=0.0),
        progress=seen.append,
    )
    stages = list(dict.fromkeys(at.stage for at in seen))
    assert stages[:4] == [f"start {k} of 4" for k in range(1, 5)]
    assert stages[-1] == ""
    assert max(at.iteration for at in seen if at.stage == stages[0]) in (10, 30)


@pytest.mark.parametrize("iterations", [15, 55, 81])
def test_an_interrupt_while_starts_are_compared_gives_the_best_of_them(iterations: int) -> None:
    seen: list[FitProgress] = []
    experiments = [measured(hardening(), multisine(0))]
    found = identify_pnlss(
        experiments,
        states=2,
        saturating=2,
        settings=FitSettings(tolerance=0.0),
        progress=stopped_after(iterations, seen),
    )
    assert found.interrupted
    assert found.training_error == min(at.training_error for at in seen)
    assert pnlss_errors(found.model, experiments).relative[0, 0] == pytest.approx(found.training_error, rel=1e-6)


def test_an_interrupt_before_there_is_any_fit_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    experiments = [measured(hardening(), multisine(0))]
    for module, name in ((linear_model_module, "linear_start"), (compared_starts, "fit_pnlss")):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, interrupt)
            with pytest.raises(KeyboardInterrupt):
                identify_pnlss(experiments, states=2, saturating=2)
    with monkeypatch.context() as patch:  # between the last of the starts that are compared and what follows
        patch.setattr(identify, "fit_pnlss", interrupt)
        found = identify_pnlss(experiments, states=2, saturating=2)
    assert found.interrupted
    assert found.training_error < 0.1


def test_two_states_in_a_narrow_band_are_found() -> None:
    """A mode at 25 Hz, shaken from 15 to 35 Hz at 800 Hz: all lines lie within nine degrees of the circle."""
    exact = linear_model(oscillator(frequency_hz=25.0, damping=0.005))
    band = (15.0, 35.0)
    experiments = [
        measured(exact, multisine(seed, band_hz=band, samples=8192), noise=1e-3, seed=seed, settling=2)
        for seed in range(2)
    ]
    found = linear_pnlss(experiments, states=2)
    values, expected = np.linalg.eigvals(found.a), np.linalg.eigvals(exact.a)
    assert np.max(np.abs(np.sort_complex(values) - np.sort_complex(expected))) < 2e-5
    states = found.simulate(experiments[0].inputs).states[:, 8192:]
    np.testing.assert_allclose(states @ states.T / 8192, np.eye(2), atol=0.2)


def test_of_too_many_states_for_a_band_it_says_how_many_it_tells() -> None:
    exact = linear_model(oscillator(frequency_hz=25.0))
    experiments = [measured(exact, multisine(0, band_hz=(24.0, 26.0)))]
    with refused(IdentificationError, "lines-in-to-hz-at-hz", field="states", value=12):
        identify_pnlss(experiments, states=12, degrees=())


def test_of_more_states_than_move_the_outputs_a_note_says_how_many_do() -> None:
    linear = linear_model(oscillator(outputs=2))
    experiments = [measured(linear, multisine(seed), noise=1e-3, seed=seed) for seed in range(2)]
    fewer = "states: 2 of 4 hardly affect the outputs of the linear model; 2 may be enough"
    assert fewer in linear_pnlss(experiments, states=4).notes
    assert not any("hardly" in note for note in linear_pnlss(experiments, states=2).notes)


def test_an_order_with_more_parameters_than_values_is_refused_before_anything_is_fitted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(identify, "linear_pnlss", None)
    experiments = [measured(hardening(outputs=2), multisine(0))]
    with refused(IdentificationError, "values-of-outputs-count-fewer-than-2", field="experiments"):
        identify_pnlss(experiments, states=20)


def test_an_unstable_start_is_reflected_and_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    stable = oscillator()
    outside = stable._replace(a=stable.a * 1.05 / spectral_radius(stable.a))
    inside = reflected(outside)
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(inside.a)),
        np.sort_complex(1.0 / np.conj(np.linalg.eigvals(outside.a))),
    )
    assert reflected(stable) is stable
    unstable: list[bool] = []

    def recorded(model: StateSpace) -> StateSpace:
        unstable.append(spectral_radius(model.a) >= 1.0)
        return reflected(model)

    monkeypatch.setattr(linear_model_module, "reflected", recorded)
    responses = best_linear_responses([measured(linear_model(stable), multisine(3, samples=256), noise=0.15)])
    assert spectral_radius(linear_start(responses, 8, sample_rate_hz=RATE_HZ).model.a) < 1.0
    assert any(unstable)


@pytest.mark.slow
def test_without_periodic_experiments_a_regression_or_a_given_linear_model_begins_the_fit() -> None:
    exact = hardening()
    record = measured(exact, multisine(0))
    segment = replace(record, period_samples=0, counted_from=1000)
    begun = identify_pnlss([segment], states=2)
    assert begun.training_error < 1e-3
    assert "no periods: responses of a regression" in " ".join(begun.model.notes)
    found = identify_pnlss([segment], states=2, linear=oscillator())
    assert found.training_error < 1e-3
    np.testing.assert_array_equal(found.linear.a, oscillator().a)
    assert identify_pnlss([segment], states=2, linear=linear_model(oscillator())).training_error < 1e-3


def test_features_are_those_that_were_asked_for() -> None:
    experiments, once = [measured(hardening(), multisine(0))], FitSettings(iterations=1)

    def features(**asked: object) -> tuple[int, int, int, int]:
        model = identify_pnlss(experiments, states=2, settings=once, **asked).model  # type: ignore[arg-type]
        parts = (model.state_features, model.output_features)
        return (*(len(p.exponents) for p in parts), *(len(p.weights) for p in parts))

    assert features() == (16, 16, 0, 0)
    assert features(degrees=(3,), output_degrees=()) == (10, 0, 0, 0)
    assert features(variables="states") == (7, 7, 0, 0)
    assert features(variables=(0,), output_degrees=(2,)) == (2, 1, 0, 0)
    assert features(saturating=4) == (0, 0, 4, 4)  # the output is an acceleration
    assert features(saturating=(4, 1), degrees=(2,), output_degrees=()) == (6, 0, 4, 1)
    own = Features.monomials(2, 1, (5,), of=(1,))
    assert features(state_features=own, output_features=Features.none(2, 1)) == (1, 0, 0, 0)
    both = replace(own, weights=np.ones((2, 4)))
    assert features(state_features=both, output_degrees=(), saturating=(0, 1)) == (1, 0, 2, 1)


def test_outputs_that_forces_do_not_act_on_at_once_have_no_saturating_features() -> None:
    exact = hardening()
    record = measured(exact, multisine(0))
    moved = replace(record, output_channels=tuple(replace(c, unit="m") for c in channels(1, 1)[1]))
    model = identify_pnlss([moved], states=2, saturating=3, settings=FitSettings(iterations=1)).model
    assert (len(model.state_features.weights), len(model.output_features.weights)) == (3, 0)


def test_what_cannot_be_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    experiments = [measured(hardening(), multisine(0))]
    with refused(IdentificationError, field="states", value=0, allowed="at least 1, whole"):
        identify_pnlss(experiments, states=0)
    with refused(IdentificationError, field="states", value=2.5, allowed="at least 1, whole"):
        identify_pnlss(experiments, states=2.5)  # type: ignore[arg-type]
    with refused(IdentificationError, "output-is-zero-throughout-the-training"):
        identify_pnlss([replace(experiments[0], outputs=0.0 * experiments[0].outputs)], states=2)
    with refused(IdentificationError, "value-at-is-nan-2", field="experiment 'run', outputs", allowed="finite"):
        replace(experiments[0], name="run", outputs=np.nan * experiments[0].outputs)
    with refused(IdentificationError, "has-shape-2", field="sample_rate_hz", allowed="one number"):
        replace(experiments[0], sample_rate_hz=np.linspace(0.0, 1.0, 9))
    with refused(
        IdentificationError, field="variables", value="inputs", allowed="all, states, or numbers of variables"
    ):
        identify_pnlss(experiments, states=2, variables="inputs")  # type: ignore[arg-type]
    with refused(IdentificationError, field="saturating", value=-1, allowed="0 and above"):
        identify_pnlss(experiments, states=2, saturating=-1)
    with refused(IdentificationError, "beside-features-of-one-own", field="saturating"):
        identify_pnlss(experiments, states=2, saturating=3, state_features=Features.none(2, 1))
    with refused(IdentificationError, "has-shape-3", field="linear", allowed="(4, 4)"):
        identify_pnlss(experiments, states=4, linear=oscillator())
    with refused(IdentificationError, "has-an-eigenvalue-of-magnitude-2", field="linear"):
        identify_pnlss(experiments, states=2, linear=oscillator()._replace(a=2.0 * np.eye(2)))
    monkeypatch.setattr(checks, "available_bytes", lambda: 1000)
    with refused(IdentificationError, "the-fit-needs", field="memory"):
        identify_pnlss(experiments, states=2)


def test_a_constant_input_makes_up_for_offsets_that_nobody_knows() -> None:
    exact = hardening()
    plain = [measured(exact, multisine(seed)) for seed in range(3)]
    offset = [replace(e, inputs=e.inputs + 0.3, outputs=e.outputs - 0.2) for e in plain]
    *training, test = [e.with_constant_input() for e in offset]
    found = identify_pnlss(training, states=2, settings=FitSettings(iterations=30))
    assert found.model.state_features.count == 16  # the constant is in no monomial
    assert pnlss_errors(found.model, [test]).overall[0] < 1e-3
    without = identify_pnlss(offset[:2], states=2, settings=FitSettings(iterations=30))
    assert pnlss_errors(without.model, offset[2:]).overall[0] > 0.01


def test_averaged_periods_stand_for_all_of_them() -> None:
    record = measured(hardening(), multisine(0), periods=4, noise=0.1)
    mean = record.averaged(transient_samples=500)
    assert (mean.counted_from, mean.counted, mean.period_samples) == (500, 1024, 1024)
    clean = measured(hardening(), multisine(0)).counted_outputs
    ratio = np.std(mean.counted_outputs - clean) / np.std(record.counted_outputs[:, :1024] - clean)
    assert ratio == pytest.approx(0.5, abs=0.05)
    np.testing.assert_array_equal(mean.inputs[:, :500], mean.counted_inputs[:, -500:])
    with refused(IdentificationError, "is-not-periodic-so-that-there"):
        replace(record, period_samples=0).averaged()
