"""Which elements a model needs: a stand-in for fits, whose errors depend on nothing but the elements that a model has."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification import ElementPlan, IdentificationError
from identification.experiments.residuals import ResidualAndNoise
from identification.models.structured.element_trials import Scores
from identification.models.structured.laws import Jenkins, PolynomialDamper, PolynomialSpring, Stop
from identification.models.structured.selection import select_elements, usual_fits

PLANS = {
    "J": ElementPlan((Jenkins(),)),
    "S": ElementPlan((PolynomialSpring(),), ("tip",)),
    "T": ElementPlan((Stop(),)),
    "D": ElementPlan((PolynomialDamper(),)),
}
NAMES = {plan.name: letter for letter, plan in PLANS.items()}


class StandIn:
    """Fits of models: the letters of their elements in their order, and the error.

    ``errors``: of each model by its sorted letters; of others, that of the best part of them. ``local``: those of models where
    they are fitted from a smaller one.
    """

    def __init__(self, errors, local=None):
        self._errors, self._local = errors, local or {}
        self.fitted: list[str] = []

    def more(self, before, plans):
        model = (before[0] if before else "") + "".join(NAMES[plan.name] for plan in plans)
        self.fitted.append(letters_of(model))
        return model, self._local.get(letters_of(model), self._error(model))

    def less(self, larger, position):
        model = taken_out(larger, position)
        self.fitted.append(letters_of(model))
        return model, self._error(model)

    def scores(self, fit):
        return Scores(np.full(2, fit[1]))

    def scores_without(self, larger, position):
        return Scores(np.full(2, self._error(taken_out(larger, position))))

    def _error(self, model):
        return min(error for part, error in self._errors.items() if set(part) <= set(model))


def letters_of(model):
    return "".join(sorted(model))


def taken_out(larger, position):
    return larger[0][:position] + larger[0][position + 1 :]


def selected(letters, errors, local=None, **options):
    """Return the elements of the selected model, the trials, and what was fitted."""
    fits = StandIn(errors, local)
    found = select_elements([PLANS[letter] for letter in letters], fits, **options)
    assert [letters_of(NAMES[name] for name in trial.elements) for trial in found.trials] == fits.fitted
    assert tuple(PLANS[letter].name for letter in found.fit[0]) in [one.elements for one in found.trials if one.kept]
    return letters_of(found.fit[0]), found.trials, fits.fitted


def in_all_orders(letters, errors, **options):
    """Return what is selected and tried, which is the same in whatever order the elements are listed."""
    results = {
        (found, trials, tuple(fits))
        for order in permutations(letters)
        for found, trials, fits in [selected(order, errors, **options)]
    }
    assert len({found for found, _, _ in results}) == 1
    assert len({fits for _, _, fits in results}) == 1
    return min(results, key=lambda one: one[0])


def test_both_elements_are_kept_though_the_weaker_is_listed_first():
    found, trials, fits = in_all_orders("JS", {"": 1.0, "J": 0.6, "S": 0.3, "JS": 0.05})
    assert (found, fits) == ("JS", ("J", "S", "JS"))
    assert [trial.kept for trial in trials] == [False, True, True]
    assert [trial.error for trial in trials] == pytest.approx([0.6, 0.3, 0.05])
    assert trials[2].elements == (PLANS["S"].name, PLANS["J"].name)
    assert trials[2].compared == (PLANS["S"].name,)
    assert trials[2].gain == pytest.approx(6.0)


@pytest.mark.parametrize(("gain", "kept"), [(1.04, "S"), (1.06, "JS")])
def test_a_further_element_has_to_lower_errors_by_5_percent_however_few_records_there_are(gain, kept):
    found, _, _ = in_all_orders("JS", {"": 1.0, "J": 0.9, "S": 0.1, "JS": 0.1 / gain})
    assert found == kept


def test_a_pair_is_found_that_pays_where_neither_of_it_pays_alone():
    found, trials, fits = in_all_orders("JST", {"": 1.0, "J": 0.5, "S": 0.9, "T": 0.9, "JST": 0.2})
    assert found == "JST"
    assert fits == ("J", "S", "T", "JS", "JT", "JST", "ST")  # what was kept is tried to be left out
    assert [trial.kept for trial in trials] == [True, False, False, False, False, True, False]
    assert trials[-1].laws == ("jenkins",)


def test_a_pair_has_to_lower_errors_twice():
    errors = {"": 1.0, "J": 0.5, "S": 0.9, "T": 0.9}
    assert in_all_orders("JST", errors | {"JST": 0.5 / 1.10})[0] == "J"
    assert in_all_orders("JST", errors | {"JST": 0.5 / 1.11})[0] == "JST"


def test_an_element_that_others_make_needless_is_left_out():
    """A polynomial damper stands for a joint until joint and spring are there."""
    errors = {"": 1.0, "D": 0.4, "J": 0.6, "S": 0.7, "DS": 0.2, "DJ": 0.3, "JS": 0.101, "DJS": 0.1}
    found, trials, fits = in_all_orders("JSD", errors)
    assert found == "JS"
    assert fits[-2:] == ("DJS", "JS")
    assert trials[-1].kept
    assert trials[-1].gain == pytest.approx(0.1 / 0.101)
    assert in_all_orders("JSD", errors | {"JS": 0.11})[0] == "DJS"


def test_a_needless_element_is_not_kept_because_the_fit_with_it_left_a_local_minimum():
    """The fit of joint and spring ends at 0.3, that with a stop beside them at 0.1, and the stop does nothing."""
    errors = {"": 1.0, "J": 0.5, "S": 0.6, "T": 0.9, "JS": 0.1}
    found, trials, fits = in_all_orders("JST", errors, local={"JS": 0.3})
    assert found == "JS"
    assert fits == ("J", "S", "T", "JS", "JT", "JST", "ST", "JS")
    assert trials[7].kept
    assert trials[7].compared == tuple(PLANS[letter].name for letter in "JST")
    assert (trials[7].laws, trials[7].error) == (("stop",), pytest.approx(0.1))


def test_equal_elements_are_told_apart_by_their_number_only():
    errors = {"": 1.0, "J": 0.5}
    found, _, fits = selected("JJ", errors)
    assert (found, fits) == ("J", ["J", "JJ"])


def test_without_data_for_validation_all_are_kept_the_strongest_first():
    found, trials, fits = in_all_orders("JST", {"": 1.0, "J": 0.5, "S": 0.2, "T": 0.9}, selective=False)
    assert found == "JST"
    assert fits == ("J", "S", "T", "JS", "ST", "JST")
    assert all(np.isnan(trial.error) and np.isnan(trial.gain) for trial in trials)


@settings(max_examples=25)
@given(st.sampled_from(["JS", "JST", "DJST"]), st.integers(0, 2**32), st.floats(0.0, 3.0))
def test_what_is_selected_does_not_depend_on_the_order(among, seed, spread):
    random = np.random.default_rng(seed)
    parts = ["".join(c for i, c in enumerate(among) if n >> i & 1) for n in range(2 ** len(among))]
    errors = dict(zip(parts, np.exp(-spread * random.random(len(parts))).tolist(), strict=True))
    found, trials, fits = selected(among, errors)
    found_again, _, fits_again = selected(random.permutation(list(among)), errors)
    assert (found, fits) == (found_again, fits_again)
    n = len(among)
    assert usual_fits(n)[0] <= len(set(fits)) == len(fits) <= usual_fits(n)[1]
    assert found == [fit for fit, trial in zip(fits, trials, strict=True) if trial.kept][-1]


def by_noise(squares):
    """Scores of a record with 50 lines of noise 1; ``squares`` is the residual's relative to it."""
    residual = np.full((1, 1), 50.0 * squares)
    return Scores(
        np.array([np.sqrt(squares)]), ResidualAndNoise(residual, np.full((1, 1), 50.0), np.full((1, 1), 50.0))
    )


@pytest.mark.parametrize(("before", "after", "pays"), [(1.0, 0.95, False), (1.0, 0.945, False), (1.0, 0.9, True)])
def test_errors_that_noise_explains_have_to_fall_by_5_percent(before, after, pays):
    assert by_noise(after).pays_over(by_noise(before), 1) == pays


def test_a_gain_that_noise_may_have_made_does_not_count():
    """Ten lines: a gain of 15 % is within chance as long as the residual is noise, and is not if it is ten times that."""
    ten = np.full((1, 1), 10.0)

    def scores(squares):
        return Scores(np.array([np.sqrt(squares)]), ResidualAndNoise(squares * ten, ten, ten))

    assert not scores(1.0 / 1.3).pays_over(scores(1.0), 1)
    assert scores(100.0 / 1.3).pays_over(scores(100.0), 1)
    assert scores(1.0 / 1.3).likelihood_over(scores(1.0)) == pytest.approx(10.0 * (1.0 - 1.0 / 1.3))


def test_an_element_that_cannot_be_fitted_does_not_pay_and_where_none_can_the_reason_is_told():
    class NoJoint(StandIn):
        def more(self, before, plans):
            if PLANS["J"] in plans:
                raise IdentificationError("no joint")
            return super().more(before, plans)

    fits = NoJoint({"": 1.0, "S": 0.5})
    found = select_elements([PLANS["J"], PLANS["S"]], fits)
    assert found.fit == ("S", 0.5)
    assert [trial.error for trial in found.trials] == [np.inf, 0.5, np.inf]
    for plans in (["J"], ["J", "J"]):
        with pytest.raises(IdentificationError, match="no joint"):
            select_elements([PLANS[letter] for letter in plans], fits)
    with pytest.raises(IdentificationError, match="no joint"):
        select_elements([PLANS["J"], PLANS["S"]], fits, selective=False)
