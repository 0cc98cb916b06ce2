"""Which law an element has: cheap rankings of all candidates, full fits of few, and held-out data that decide."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Generic, Protocol, TypeVar

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.residuals import EXPLAINED, lacks_something
from identification.models.structured.candidates import CANDIDATES, LINEAR, NO_LAW, PAIRS, Candidate
from identification.models.structured.element_trials import LEAST_GAIN, ElementTrial, Scores
from identification.models.structured.model import StructuredModel
from identification.models.structured.selection import Selected
from identification.models.structured.start import Start

T = TypeVar("T")
_UNFITTED = Scores(np.array([math.inf]))

_RIVAL = 1.5
"""Error of a short fit relative to the least, up to which a candidate is fitted in full. Chosen: short fits of right laws came
to 1.45 times the least."""
_FITS = 3
"""Most candidates that are fitted in full before pairs are."""
_KNOWN, _TRIED = 1.0 / 2.0, 1.0 / 3.0
"""Power of what the best regression leaves of all, up to which others are promising; and that of laws of which a regression
tries few values of a number, such as the slip of a joint. Chosen."""
_ALIKE = 1.1
"""What the regression of a spring leaves relative to the best, up to which it is tried in pairs. Chosen."""
_AGAIN = 3
"""Most further starts of one candidate, as in a fit of one element."""
_CLOSE = 10.0
"""Error relative to that of the candidate that is kept, up to which one is begun again. Chosen."""

USUAL_CHOICE = (1, 3)
"""Full fits that a choice usually takes, least and most."""


class LawFits(Protocol[T]):
    """Fits of the laws of one element, from cheap to full."""

    def regressed(self, candidate: Candidate) -> list[Start]:
        """Return starts, the one with the least residual first."""

    def screened(self, candidate: Candidate, starts: Sequence[StructuredModel]) -> float:
        """Return the error of a short fit from one of the starts."""

    def fitted(self, candidate: Candidate, starts: Sequence[StructuredModel]) -> T:
        """Return the best of the fits from these starts, up to the first whose residual the noise explains."""

    def scores(self, fit: T) -> Scores:
        """Return how well a model fits the validation data."""


@dataclass(eq=False)
class _Tried(Generic[T]):
    """A candidate, and what is known of it so far."""

    candidate: Candidate
    starts: list[StructuredModel]
    """By what their regressions leave, the least first."""
    residual: float
    further: list[StructuredModel]
    """Starts from which it was not fitted."""
    screening: float = math.nan
    fit: T | None = None
    scores: Scores = _UNFITTED
    compared: "_Tried[T] | None" = None
    kept: bool = False

    @property
    def explained(self) -> bool:
        """Whether noise explains its residual in the validation data, where that is known."""
        known = self.scores.over_noise[~np.isnan(self.scores.over_noise)]
        return bool(known.size) and bool(np.all(known <= EXPLAINED))

    @property
    def lacking(self) -> bool:
        """Whether it lacks something, or could not be fitted."""
        return self.fit is None or bool(np.any(lacks_something(self.scores.over_noise, self.scores.errors[:, None])))

    def makes_needless(self, larger: "_Tried[T]") -> bool:
        """Whether a law with more numbers is not worth a fit: its short fit is worse, and this fit is no local minimum."""
        more = larger.candidate.numbers > self.candidate.numbers
        return more and self.screening < larger.screening and self.scores.size <= self.screening


def choose_law(
    fits: LawFits[T],
    between: tuple[str, ...] = (),
    candidates: Sequence[Candidate] = CANDIDATES,
    pairs: Sequence[tuple[str, str]] = PAIRS,
) -> Selected[T]:
    """Return the fit of the law that explains the data, the one with fewer numbers where two do, and all that was tried.

    1. Regressions of all candidates, and of springs beside dampers and joints. Dropped are those that gain less than 5 %, and
       pairs that leave hardly less than one of both alone; of the others those that leave much more than the best, unless they
       are the best of their family.
    2. Short fits of the others, and of no law (`identification.models.structured.screening`).
    3. Full fits of up to three with errors of at most 1.5 times the least, the best and those with the fewest numbers, until
       noise explains the residual of the validation data. Left out are larger ones whose short fits are worse. A larger one is
       kept if it pays (`Scores.pays_over`).
    4. If what is kept lacks something (`lacks_something`), laws that are late (`Candidate.late`), and the best pair, likewise;
       and then further starts of the smallest law near it.

    Raises `IdentificationError` if no candidate can be fitted.
    """
    return _Choice(fits, between, candidates, pairs).made()


class _Choice(Generic[T]):
    def __init__(
        self,
        fits: LawFits[T],
        between: tuple[str, ...],
        candidates: Sequence[Candidate],
        pairs: Sequence[tuple[str, str]],
    ) -> None:
        self._fits, self._between, self._pairs = fits, between, pairs
        self._linear = self._regressed(NO_LAW)
        self._single = self._by_residual([one for one in candidates if not one.late])
        self._late = [one for one in candidates if one.late]
        self._paired: list[_Tried[T]] = []
        self._fitted: list[_Tried[T]] = []
        self._kept: _Tried[T] | None = None
        self._refusal: IdentificationError | None = None

    def made(self) -> Selected[T]:
        """Choose."""
        useful = [one for one in self._single if one.residual * LEAST_GAIN <= self._linear.residual]
        pairs = self._promising_pairs()
        if useful or pairs:
            self._fit_rivals([self._linear, *self._promising(useful, pairs), *pairs])
        else:
            self._fit_rivals([self._linear])
            if self._lacking():
                self._fit_rivals(self._single)
        late = [one for one in self._late if not one.refines or one.refines in self._kinds()]
        if late and self._lacking():
            regressed = self._by_residual(late)
            self._fit_rivals(regressed, below=self._least())
            self._single += regressed
        rest = [one for one in self._paired if one not in pairs]
        if rest and self._lacking():
            self._fit_rivals(rest[:1], below=self._least())
        self._begin_again()
        if self._kept is None or self._kept.fit is None:
            raise self._refusal or IdentificationError("no law could be fitted", field="laws")
        return Selected(self._kept.fit, tuple(self._trials()))

    def _promising(self, useful: Sequence[_Tried[T]], pairs: Sequence[_Tried[T]]) -> list[_Tried[T]]:
        least = min(one.residual for one in (*useful, *pairs))
        first = {one.candidate.family: one for one in reversed(useful)}.values()  # the least of each family
        share = least / self._linear.residual
        return [
            one
            for one in useful
            if one.residual <= self._linear.residual * share ** (_TRIED if one.candidate.tried > 1 else _KNOWN)
            or one in first
        ]

    def _promising_pairs(self) -> list[_Tried[T]]:
        """Regress pairs, and return those that leave less than each of both alone, the best first.

        The second law that tries the fewest values, of these the one with the most numbers, is regressed beside all springs
        that are nearly as good as the best; the others of its family, if it pays, beside the spring with which it leaves least.
        """
        found = []
        for first, second in self._pairs:
            ones, others = ([one for one in self._single if one.candidate.family == of] for of in (first, second))
            others.sort(key=lambda one: (one.candidate.tried, -one.candidate.numbers))
            if not ones or not others:
                continue
            probes = [(one, self._pair(one, others[0])) for one in ones if one.residual <= _ALIKE * ones[0].residual]
            least = min(pair.residual for _, pair in probes)
            alike = [(one, pair) for one, pair in probes if pair.residual <= LEAST_GAIN * least]
            one, pair = min(alike, key=lambda both: both[1].candidate.numbers)
            self._paired.append(pair)
            if pair.residual * LEAST_GAIN <= min(one.residual, others[0].residual):
                further = [self._pair(one, other) for other in others[1:]]
                self._paired += further
                found += [pair, *further]
        self._paired.sort(key=lambda pair: pair.residual)
        return sorted(found, key=lambda pair: pair.residual)

    def _pair(self, one: _Tried[T], other: _Tried[T]) -> _Tried[T]:
        (element,) = one.starts[0].elements
        return self._regressed(other.candidate.beside(element.laws))

    def _by_residual(self, candidates: Sequence[Candidate]) -> list[_Tried[T]]:
        return sorted((self._regressed(one) for one in candidates), key=lambda one: one.residual)

    def _regressed(self, candidate: Candidate) -> _Tried[T]:
        found = self._fits.regressed(candidate)
        starts = [one.model for one in found]
        return _Tried(candidate, starts, found[0].residual, starts[1:])

    def _screened(self, one: _Tried[T]) -> _Tried[T]:
        if math.isnan(one.screening):
            one.screening = self._fits.screened(one.candidate, one.starts)
        return one

    def _fit_rivals(self, among: Sequence[_Tried[T]], below: float = math.inf) -> None:
        """Fit those whose short fits are nearly as good as the best, from few to many numbers, until noise explains one.

        ``below``: error of short fits to which theirs are compared as well.
        """
        if among[0].candidate.laws or len(among) > 1:
            among = [self._screened(one) for one in among]
        least = min([below, *(one.screening for one in among)])
        rivals = [one for one in among if not one.screening > _RIVAL * least]  # that of a single one is not known
        rivals.sort(key=lambda one: (one.candidate.numbers, one.screening))
        good = [one for one in rivals if not one.screening > LEAST_GAIN * least]
        best = sorted(good, key=lambda one: (one.candidate.numbers, one.candidate.tried))[:1]
        few = [one for one in rivals if one not in best][: _FITS - 1]
        for one in sorted([*few, *best], key=rivals.index):
            if self._settled():
                return
            if not any(other.makes_needless(one) for other in self._fitted):
                self._fit(one, partial(self._fits.fitted, one.candidate, one.starts[:1]))
                if one is self._fitted[0] and one.lacking and one.scores.size > one.screening:  # a local minimum
                    self._fit_again(one, 1)

    def _least(self) -> float:
        """Return the least error of the short fits of what was fitted; inf without any."""
        return min((one.screening for one in self._fitted if not math.isnan(one.screening)), default=math.inf)

    def _kinds(self) -> list[str]:
        return [] if self._kept is None else [law.kind for law in self._kept.candidate.laws]

    def _settled(self) -> bool:
        return self._kept is not None and self._kept.explained

    def _lacking(self) -> bool:
        return self._kept is None or self._kept.lacking

    def _fit(self, one: _Tried[T], fit: Callable[[], T]) -> None:
        try:
            one.fit = fit()
        except IdentificationError as error:
            self._refusal = self._refusal or error
        else:
            one.scores = self._fits.scores(one.fit)
        one.compared = self._kept
        self._fitted.append(one)
        if one.fit is not None and (self._kept is None or one.scores.pays_over(self._kept.scores, 1)):
            self._kept, one.kept = one, True

    def _begin_again(self) -> None:
        """Fit one candidate from further starts if that which is kept lacks something: the smallest that is close to it."""
        kept = self._kept
        if kept is None or not kept.lacking:
            return
        close = [one for one in self._fitted if one.scores.size <= _CLOSE * kept.scores.size and one.further]
        if close:
            self._fit_again(min(close, key=lambda one: one.candidate.numbers), _AGAIN)

    def _fit_again(self, one: _Tried[T], most: int) -> None:
        """Fit a candidate from its next starts."""
        if starts := one.further[:most]:
            one.further = one.further[most:]
            again = replace(one, compared=None, kept=False, fit=None, further=one.further, scores=_UNFITTED)
            self._fit(again, partial(self._fits.fitted, again.candidate, starts))

    def _trials(self) -> list[ElementTrial]:
        """Models that were fitted in their order; then those that were not, by the error of their short fits."""
        known = [self._linear, *self._single, *self._paired]
        others = [one for one in known if one not in self._fitted]
        others.sort(key=lambda one: (math.isnan(one.screening), one.screening, one.residual))
        return [self._trial(one) for one in (*self._fitted, *others)]

    def _trial(self, one: _Tried[T]) -> ElementTrial:
        compared, fitted = one.compared, one in self._fitted
        gain = at_least = likelihood = math.nan
        if compared is not None:
            gain, at_least = (of(compared.scores) for of in (one.scores.gain_over, one.scores.gain_at_least))
            likelihood = one.scores.likelihood_over(compared.scores)
        ratios = one.scores.over_noise[~np.isnan(one.scores.over_noise)]
        return ElementTrial(
            laws=tuple(law.kind for law in one.candidate.laws),
            between=self._between,
            elements=(self._name(one),),
            compared=() if compared is None else (self._name(compared),),
            error=one.scores.rms if fitted else math.nan,
            gain=gain,
            at_least=at_least,
            likelihood=likelihood,
            kept=one.kept,
            regression=one.residual / self._linear.residual,
            screening=one.screening,
            over_noise=float(np.max(ratios)) if fitted and ratios.size else math.nan,
        )

    def _name(self, one: _Tried[T]) -> str:
        at = f"@{':'.join(self._between)}" if self._between and one.candidate.name != LINEAR else ""
        return one.candidate.name + at
