"""Which law an element has: a stand-in for fits, whose errors depend on nothing but the laws."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification import IdentificationError
from identification.experiments.residuals import ResidualAndNoise
from identification.models import LAWS
from identification.models.structured.candidates import CANDIDATES, PAIRS
from identification.models.structured.element_trials import Scores
from identification.models.structured.law_choice import choose_law
from identification.models.structured.start import Start

NOISE = 1e-3
BETWEEN = ("tip", "drive")


class StandIn:
    """Fits whose errors are given by the names of the laws, in three dictionaries; of other laws they are those of no law.

    ``further``: errors of fits from further starts. ``noise``: whether the periods show the noise.
    """

    def __init__(self, regression, short, full, further=None, noise=True):
        self.regression, self.short, self.full = regression, short, full
        self.further, self.noise = further or {"linear": 1.0}, noise
        self.screens, self.fits = [], []

    def regressed(self, candidate):
        found = SimpleNamespace(elements=(SimpleNamespace(laws=candidate.laws),), further=False)
        again = SimpleNamespace(elements=found.elements, further=True)
        return [Start(found, self._of(self.regression, candidate)), Start(again, 2.0)]

    def screened(self, candidate, starts):
        self.screens.append(candidate.name)
        return self._of(self.short, candidate)

    def fitted(self, candidate, starts):
        of = self.further if starts[0].further else self.full
        self.fits.append(candidate.name + " again" * starts[0].further)
        error = self._of(of, candidate)
        if error is None:
            raise IdentificationError(f"no {candidate.name}")
        return candidate.name, error

    def scores(self, fit):
        squares = np.full((1, 1), (fit[1] / NOISE) ** 2)
        known = ResidualAndNoise(100.0 * squares, np.full((1, 1), 100.0), np.full((1, 1), 100.0))
        return Scores(np.array([fit[1]]), known if self.noise else None)

    @staticmethod
    def _of(errors, candidate):
        return errors.get(candidate.name, errors["linear"])


def chosen(fits):
    found = choose_law(fits, BETWEEN)
    assert [one.kept for one in found.trials[len(fits.fits) :]] == [False] * (len(found.trials) - len(fits.fits))
    assert [one for one in found.trials if one.kept][-1].error == found.fit[1]
    return found.fit[0], found.trials


def linear_and(**errors):
    """Errors by name, in which _ is a hyphen, and 1 of no law."""
    return {"linear": 1.0} | {name.replace("_", "-"): error for name, error in errors.items()}


def test_the_law_that_noise_explains_is_found_with_one_full_fit():
    fits = StandIn(
        linear_and(jenkins=0.4, masing=0.3, polynomial_spring=0.9),
        linear_and(jenkins=0.02, masing=0.25, polynomial_spring=1.1),
        linear_and(jenkins=NOISE),
    )
    found, trials = chosen(fits)
    assert (found, fits.fits) == ("jenkins", ["jenkins"])
    assert set(fits.screens) == {
        "linear",
        "jenkins",
        "masing",
        "polynomial-spring",
    }  # the best of each family, and near ones
    assert trials[0].elements == ("jenkins@tip:drive",)
    assert trials[0].over_noise == pytest.approx(1.0)
    assert [(one.elements[0], one.regression, one.screening) for one in trials[1:3]] == [
        ("masing@tip:drive", 0.3, 0.25),
        ("linear", 1.0, 1.0),
    ]
    assert np.isnan(trials[-1].error)
    assert np.isnan(trials[-1].screening)


def test_of_two_that_noise_explains_the_one_with_fewer_numbers_is_fitted_and_kept():
    laws = {"magnet": 0.031, "spline_spring": 0.03, "polynomial_spring": 0.03}
    fits = StandIn(linear_and(**laws), linear_and(**laws), linear_and(**dict.fromkeys(laws, NOISE)))
    assert chosen(fits)[0] == "magnet"
    assert fits.fits == ["magnet"]


@pytest.mark.parametrize(("gain", "kept"), [(1.04, "magnet"), (1.06, "spline-spring")])
def test_a_larger_law_has_to_lower_errors_by_5_percent(gain, kept):
    laws = {"magnet": 0.03, "spline_spring": 0.03}
    fits = StandIn(linear_and(**laws), linear_and(**laws), linear_and(magnet=0.03, spline_spring=0.03 / gain))
    found, trials = chosen(fits)
    assert found == kept
    assert fits.fits[:2] == ["magnet", "spline-spring"]
    assert trials[1].compared == ("magnet@tip:drive",)
    assert trials[1].gain == pytest.approx(gain)


def test_where_the_noise_is_unknown_rivals_are_fitted_too():
    laws = {"magnet": 0.03, "spline_spring": 0.03}
    fits = StandIn(linear_and(**laws), linear_and(**laws), linear_and(magnet=NOISE, spline_spring=NOISE), noise=False)
    found, trials = chosen(fits)
    assert (found, fits.fits[:2]) == ("magnet", ["magnet", "spline-spring"])
    assert np.isnan(trials[0].over_noise)


def test_where_no_regression_gains_5_percent_a_linear_structure_is_fitted_first_and_others_if_it_lacks_something():
    fits = StandIn(linear_and(stop=0.96), linear_and(), {"linear": NOISE})
    found, trials = chosen(fits)
    assert (found, fits.fits, fits.screens) == ("linear", ["linear"], [])
    assert trials[0].laws == ()
    fits = StandIn(linear_and(stop=0.96), linear_and(stop=0.2), {"linear": 0.5, "stop": NOISE})
    assert chosen(fits)[0] == "stop"
    assert fits.fits == ["linear", "stop"]


def test_a_pair_is_found_whose_laws_hide_each_other():
    """Spring and joint that change the frequency the opposite way; the polynomial is simpler than the spline."""
    pairs = dict.fromkeys(("polynomial-spring,masing", "spline-spring,masing", "polynomial-spring,jenkins"), 0.3)
    fits = StandIn(
        linear_and(polynomial_spring=0.9, spline_spring=0.89) | pairs,
        linear_and() | pairs | {"polynomial-spring,jenkins": 0.21},
        linear_and() | {"polynomial-spring,jenkins": NOISE},
    )
    assert chosen(fits)[0] == "polynomial-spring,jenkins"
    assert fits.fits == ["polynomial-spring,jenkins"]
    assert "spline-spring,masing" not in fits.screens


def test_of_laws_that_all_lack_something_the_smallest_near_the_best_begins_again():
    laws = {"iwan": 0.03, "masing": 0.025, "jenkins": 0.3}
    full = linear_and(iwan=0.02, masing=0.004, jenkins=0.2)
    fits = StandIn(linear_and(**laws), linear_and(**laws), full, further=linear_and(iwan=NOISE))
    found, trials = chosen(fits)
    assert (found, fits.fits) == ("iwan", ["iwan", "masing", "iwan again"])
    assert [one.kept for one in trials[:3]] == [True, True, True]
    fits = StandIn(linear_and(**laws), linear_and(**laws), full, further=linear_and(iwan=0.02))
    assert chosen(fits)[0] == "masing"


def test_at_most_three_laws_are_fitted_before_one_begins_again():
    laws = dict.fromkeys(("polynomial_spring", "spline_spring", "stop", "magnet", "jenkins", "iwan"), 0.5)
    fits = StandIn(linear_and(**laws), linear_and(**laws), linear_and(**laws), further=linear_and())
    chosen(fits)
    assert len([name for name in fits.fits if "again" not in name]) == 3
    assert len(fits.fits) == 4


def test_a_law_that_cannot_be_fitted_is_listed_and_where_none_can_the_reason_is_told():
    laws = {"stop": 0.03, "magnet": 0.03}
    fits = StandIn(linear_and(**laws), linear_and(**laws), {"linear": 1.0, "stop": None, "magnet": NOISE})
    found, trials = chosen(fits)
    assert (found, trials[0].error) == ("magnet", np.inf)
    with pytest.raises(IdentificationError, match="no "):
        choose_law(StandIn(linear_and(**laws), linear_and(**laws), {"linear": None}, further={"linear": None}))


def test_every_law_that_needs_nothing_from_the_user_is_a_candidate():
    kinds = {law.kind for one in CANDIDATES for law in one.laws}
    assert kinds == set(LAWS) - {"user-spring"}
    names = [one.name for one in CANDIDATES]
    assert len(set(names)) == len(names)
    assert {one.family for one in CANDIDATES} == {family for pair in PAIRS for family in pair}


def test_a_larger_law_is_not_fitted_if_its_short_fit_is_worse_unless_the_smaller_ended_in_a_local_minimum():
    short = linear_and(magnet=0.030, spline_spring=0.033)
    for error, fitted in ((0.02, ["magnet", "magnet again"]), (0.5, ["magnet", "magnet again", "spline-spring"])):
        fits = StandIn(short, short, linear_and(magnet=error, spline_spring=NOISE))
        chosen(fits)
        assert fits.fits == fitted


def test_a_full_fit_that_is_worse_than_its_short_fit_begins_again_before_larger_laws_are_fitted():
    short = linear_and(jenkins=0.03, iwan=0.03)
    fits = StandIn(short, short, linear_and(jenkins=0.1, iwan=NOISE), further=linear_and(jenkins=NOISE))
    found, trials = chosen(fits)
    assert (found, fits.fits) == ("jenkins", ["jenkins", "jenkins again"])
    assert [one.kept for one in trials[:2]] == [True, True]


def test_a_law_whose_steps_are_long_is_tried_last_and_alone():
    short = linear_and(iwan=0.03, bouc_wen=0.02)
    fits = StandIn(short, short, linear_and(iwan=0.02, bouc_wen=NOISE))
    assert chosen(fits)[0] == "bouc-wen"
    assert fits.screens.index("bouc-wen") == len(fits.screens) - 1
    fits = StandIn(short, short, linear_and(iwan=NOISE, bouc_wen=NOISE))
    assert chosen(fits)[0] == "iwan"
    assert "bouc-wen" not in fits.screens


@pytest.mark.parametrize(("kept", "tried"), [("coulomb", True), ("jenkins", False)])
def test_a_law_that_refines_another_is_tried_where_that_is_kept_and_lacks_something(kept, tried):
    short = linear_and(**{kept: 0.03}, stribeck=0.02)
    fits = StandIn(short, short, linear_and(**{kept: 0.02}, stribeck=NOISE))
    found, _ = chosen(fits)
    assert ("stribeck" in fits.screens) == tried
    assert found == ("stribeck" if tried else kept)
    fits = StandIn(short, short, linear_and(**{kept: NOISE}, stribeck=NOISE))
    assert chosen(fits)[0] == kept
    assert "stribeck" not in fits.screens
