"""Which of several elements a model needs, whatever the order in which they are listed."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from identification.errors import IdentificationError
from identification.models.structured.element_trials import ElementPlan, ElementTrial, Scores

T = TypeVar("T")

Elements = tuple[int, ...]
"""Numbers of plans. Equal plans share one, which is then there several times."""

_AT_A_TIME = (1, 2)
"""Elements that are added at a time: one, or two where none pays alone."""


def usual_fits(plans: int) -> int:
    """Return the number of fits of a selection that leaves nothing out later: n (n + 1) / 2."""
    return plans * (plans + 1) // 2


class Selected(NamedTuple, Generic[T]):
    """What a selection found."""

    fit: T
    """Fit of the model that is kept."""
    trials: tuple[ElementTrial, ...]
    """All models that were fitted, in the order in which they were."""


class _Tried(NamedTuple, Generic[T]):
    elements: Elements
    """Sorted."""
    order: Elements
    """In the order of the model."""
    fit: T | None
    scores: Scores


def select_elements(
    plans: Sequence[ElementPlan],
    fit: Callable[[T | None, Sequence[ElementPlan]], T],
    score: Callable[[T], Scores],
    selective: bool = True,
) -> Selected[T]:
    """Select elements forward, with a backward look.

    First each element is fitted alone, and the best is kept. In each further round each remaining element is fitted beside
    those kept, and the best of them is kept if it pays (`ElementTrial`). If none does, all pairs of them are fitted, and the
    best pair is kept if it pays; otherwise the search ends. After each addition earlier elements are left out in turn, as long
    as the model with them does not pay over the one without; they do not come back. Models that were fitted in earlier rounds
    were worse than the one kept then, and are not looked at again.

    Of n elements the rounds take n (n + 1) / 2 fits, and somewhat more if a pair pays; each addition to k elements takes up to
    k - 1 to leave one out. A model is fitted from the best fit that has an element less, if there is one. Listed in another
    order, the same elements give the same fits. An element that cannot be fitted counts as one that does not pay, unless none
    can.

    Parameters
    ----------
    plans
        The elements, one at least.
    fit
        Returns the fit of a model with further elements; None for the model without elements.
    score
        Returns its errors.
    selective
        False: all elements are kept, added as the errors say, and nothing is left out.
    """
    search = _Search(plans, fit, score, selective)
    kept = search.first()
    rest = _without(search.all, kept.elements)
    while rest and (larger := search.further(kept, rest)):
        new = _without(larger.elements, kept.elements)
        kept, rest = search.reduced(larger, new), _without(rest, new)
    if rest and not selective and search.refusal is not None:
        raise search.refusal
    assert kept.fit is not None
    return Selected(kept.fit, tuple(search.trials))


_UNFITTED = Scores(np.array([np.inf]))
"""Scores of a model that could not be fitted."""


class _Search(Generic[T]):
    def __init__(
        self,
        plans: Sequence[ElementPlan],
        fit: Callable[[T | None, Sequence[ElementPlan]], T],
        score: Callable[[T], Scores],
        selective: bool,
    ) -> None:
        self._fit, self._score, self._selective = fit, score, selective
        named = {_key(plan): plan for plan in plans}
        keys = sorted(named)
        self._plans = [named[key] for key in keys]
        self.all: Elements = tuple(sorted(keys.index(_key(plan)) for plan in plans))
        self.trials: list[ElementTrial] = []
        self._known: dict[Elements, _Tried[T]] = {}
        self.refusal: IdentificationError | None = None

    def first(self) -> _Tried[T]:
        """Return the best model with one element."""
        tried = [self._tried((one,)) for one in sorted(set(self.all))]
        best = _best(tried)
        assert best is not None  # there is one plan at least
        if self.refusal is not None and best.fit is None:
            raise self.refusal
        self._note(tried, None, best)
        return best

    def further(self, kept: _Tried[T], rest: Elements) -> _Tried[T] | None:
        """Return the best model with one or two elements more, if it pays."""
        for count in _AT_A_TIME:
            tried = [self._tried(_with(kept.elements, more)) for more in sorted(set(combinations(rest, count)))]
            best = _best(tried)
            pays = best is not None and self._pays(best, kept, count)
            self._note(tried, kept, best if pays else None)
            if pays:
                return best
        return None

    def reduced(self, full: _Tried[T], new: Elements) -> _Tried[T]:
        """Return the model without those earlier elements that do not pay beside the new ones."""
        kept = full
        while self._selective:
            smaller = [_without(kept.elements, (one,)) for one in sorted(set(_without(kept.elements, new)))]
            tried = [self._tried(one) for one in smaller if one not in self._known]
            best = _best(tried)
            spare = best is not None and best.fit is not None and not self._pays(full, best, 1)
            self._note(tried, full, best if spare else None)
            if best is None or not spare:
                break
            kept = best
        return kept

    def _pays(self, larger: _Tried[T], smaller: _Tried[T], count: int) -> bool:
        if larger.fit is None or not self._selective:
            return larger.fit is not None
        return larger.scores.pays_over(smaller.scores, count)

    def _tried(self, elements: Elements) -> _Tried[T]:
        if elements not in self._known:
            self._known[elements] = self._fitted(elements)
        return self._known[elements]

    def _fitted(self, elements: Elements) -> _Tried[T]:
        """Fit a model from the best of the largest parts of it that are fitted."""
        parts = [
            one for one in self._known.values() if one.fit is not None and not Counter(one.elements) - Counter(elements)
        ]
        largest = max((len(one.elements) for one in parts), default=0)
        before = _best([one for one in parts if len(one.elements) == largest])
        new = _without(elements, () if before is None else before.elements)
        order = (*(() if before is None else before.order), *new)
        try:
            fit = self._fit(None if before is None else before.fit, [self._plans[one] for one in new])
        except IdentificationError as error:
            self.refusal = self.refusal or error
            return _Tried(elements, order, None, _UNFITTED)
        return _Tried(elements, order, fit, self._score(fit))

    def _note(self, tried: Sequence[_Tried[T]], compared: _Tried[T] | None, kept: _Tried[T] | None) -> None:
        for one in tried:
            gain = likelihood = math.nan
            if self._selective and compared is not None:
                gain = one.scores.gain_over(compared.scores)
                pair = (one, compared) if len(one.elements) > len(compared.elements) else (compared, one)
                likelihood = pair[0].scores.likelihood_over(pair[1].scores)
            self.trials.append(
                ElementTrial(
                    elements=self._names(one),
                    compared=() if compared is None else self._names(compared),
                    error=one.scores.rms if self._selective else math.nan,
                    gain=gain,
                    likelihood=likelihood,
                    kept=one is kept,
                )
            )

    def _names(self, tried: _Tried[T]) -> tuple[str, ...]:
        return tuple(self._plans[one].name for one in tried.order)


def _key(plan: ElementPlan) -> tuple[str, str]:
    return plan.name, repr([law.as_dict() for law in plan.laws])


def _best(tried: Sequence[_Tried[T]]) -> _Tried[T] | None:
    return min(tried, key=lambda one: one.scores.size, default=None)


def _with(elements: Elements, more: Elements) -> Elements:
    return tuple(sorted(elements + more))


def _without(elements: Elements, less: Elements) -> Elements:
    return tuple(sorted((Counter(elements) - Counter(less)).elements()))
