"""Which of several elements a model needs, whatever the order in which they are listed."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from identification.errors import IdentificationError
from identification.models.structured.element_trials import LEAST_GAIN, ElementPlan, ElementTrial, Scores

T = TypeVar("T")

Elements = tuple[int, ...]
"""Numbers of plans. Equal plans share one, which is then there several times."""

_AT_A_TIME = (1, 2)
"""Elements that are added at a time: one, or two where none pays alone."""


def usual_fits(plans: int) -> tuple[int, int]:
    """Return how many fits a selection among n elements usually takes: n (n + 1) / 2 without a backward look, to n^2."""
    return plans * (plans + 1) // 2, plans**2


class Fits(Protocol[T]):
    """Fits of models, each from another one."""

    def more(self, before: T | None, plans: Sequence[ElementPlan]) -> T:
        """Return the fit with further elements; None for the model without any."""

    def less(self, larger: T, position: int) -> T:
        """Return the fit without the element at a position, from a fit that has it."""

    def scores(self, fit: T) -> Scores:
        """Return how well a model fits."""

    def scores_without(self, larger: T, position: int) -> Scores:
        """Return how well it fits with an element taken out and nothing fitted again."""


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


def select_elements(plans: Sequence[ElementPlan], fits: Fits[T], selective: bool = True) -> Selected[T]:
    """Select elements forward, with a backward look.

    First each element is fitted alone, and the best is kept. In each further round each remaining element is fitted beside
    those kept, and the best of them is kept if it pays (`ElementTrial`). If none does, all pairs of them are fitted, and the
    best pair is kept if it pays; otherwise the search ends. After each addition elements are left out in turn, as long as the
    model with them does not pay over the one without; they do not come back.

    The model without an element is fitted if it was not yet, or if its fit has errors 5 % above those of the larger model with
    the element taken out and nothing fitted again: then that fit ended in a local minimum, which an addition has left, needed
    or not. Other models that were fitted before were worse than those that were kept.

    Of n elements the rounds take n (n + 1) / 2 fits, more if a pair pays; after each addition to k elements up to k - 2 are
    fitted to leave one out, more after local minima. A model is fitted from the best fit that has an element less, if there
    is one. Listed in another order, the same elements give the same fits. An element that cannot be fitted counts as one that
    does not pay, unless none can.

    Parameters
    ----------
    plans
        The elements, one at least.
    fits
        Fits models.
    selective
        False: all elements are kept, added as their scores say, and nothing is left out.
    """
    search = _Search(plans, fits, selective)
    kept = search.first()
    rest = _without(search.all, kept.elements)
    while rest and (larger := search.further(kept, rest)):
        rest = _without(rest, _without(larger.elements, kept.elements))
        kept = search.reduced(larger)
    if rest and not selective and search.refusal is not None:
        raise search.refusal
    assert kept.fit is not None
    return Selected(kept.fit, tuple(search.trials))


_UNFITTED = Scores(np.array([np.inf]))
"""Scores of a model that could not be fitted."""


class _Search(Generic[T]):
    def __init__(self, plans: Sequence[ElementPlan], fits: Fits[T], selective: bool) -> None:
        self._fits, self._selective = fits, selective
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

    def reduced(self, full: _Tried[T]) -> _Tried[T]:
        """Return the model without those elements that do not pay."""
        kept = full
        while self._selective and len(kept.elements) > 1:
            tried = [one for position in range(len(kept.order)) if (one := self._tried_without(kept, position))]
            best = _best(tried)
            spare = best is not None and best.fit is not None and not self._pays(full, best, 1)
            self._note(tried, full, best if spare else None)
            if best is None or not spare:
                break
            kept = best
        return kept

    def _tried_without(self, larger: _Tried[T], position: int) -> _Tried[T] | None:
        """Fit the model without an element; None if it was fitted before, to errors hardly above those that it has now."""
        fit = larger.fit
        assert fit is not None
        order = (*larger.order[:position], *larger.order[position + 1 :])
        elements = tuple(sorted(order))
        known = self._known.get(elements)
        before = known or self._largest_part(elements)
        if before is not None:
            now = self._fits.scores_without(fit, position)
            if now.gain_over(before.scores) < LEAST_GAIN:
                return None if before is known else self._tried(elements)
        found = self._attempt(order, lambda: self._fits.less(fit, position))
        self._known[elements] = found if known is None or found.scores.size < known.scores.size else known
        return found

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
        before = self._largest_part(elements)
        new = _without(elements, () if before is None else before.elements)
        order = (*(() if before is None else before.order), *new)
        plans = [self._plans[one] for one in new]
        return self._attempt(order, lambda: self._fits.more(None if before is None else before.fit, plans))

    def _largest_part(self, elements: Elements) -> _Tried[T] | None:
        parts = [
            one for one in self._known.values() if one.fit is not None and not Counter(one.elements) - Counter(elements)
        ]
        largest = max((len(one.elements) for one in parts), default=0)
        return _best([one for one in parts if len(one.elements) == largest])

    def _attempt(self, order: Elements, fit: Callable[[], T]) -> _Tried[T]:
        try:
            found = fit()
        except IdentificationError as error:
            self.refusal = self.refusal or error
            return _Tried(tuple(sorted(order)), order, None, _UNFITTED)
        return _Tried(tuple(sorted(order)), order, found, self._fits.scores(found))

    def _note(self, tried: Sequence[_Tried[T]], compared: _Tried[T] | None, kept: _Tried[T] | None) -> None:
        self.trials += [self._trial(one, compared, one is kept) for one in tried]

    def _trial(self, tried: _Tried[T], compared: _Tried[T] | None, kept: bool) -> ElementTrial:
        gain = at_least = likelihood = math.nan
        changed = self._plans[tried.order[-1]]
        if compared is not None:
            smaller, larger = sorted((tried, compared), key=lambda one: len(one.elements))
            changed = self._plans[_without(larger.elements, smaller.elements)[-1]]
            if self._selective:
                gain, at_least = (of(compared.scores) for of in (tried.scores.gain_over, tried.scores.gain_at_least))
                likelihood = larger.scores.likelihood_over(smaller.scores)
        return ElementTrial(
            laws=tuple(law.kind for law in changed.laws),
            between=changed.between,
            elements=self._names(tried),
            compared=() if compared is None else self._names(compared),
            error=tried.scores.rms if self._selective else math.nan,
            gain=gain,
            at_least=at_least,
            likelihood=likelihood,
            kept=kept,
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
