"""A rehearsal that ends once it is certain whether the plan ends well: when it may end, and what the draws then tell.

Wald's sequential probability ratio test (A. Wald, Sequential Analysis, 1947) of whether a plan ends well on at least 95 % or on
at most 85 % of the twins, to either side of `GOOD`, with errors of 5 % each. Its draws are at most those that were asked for.

Proportions of draws that end by such a rule are biased, and their usual intervals too narrow:

- The proportion itself is estimated without bias by the share of paths of the test to where it ended that begin with a success
  (Girshick, Mosteller and Savage, Ann. Math. Statist. 17, 1946).
- Intervals are those of a confidence sequence, which holds at every number of draws at once, by whatever rule they end: all p
  with ``B(k + 1/2, n - k + 1/2) / B(1/2, 1/2) < 20 p^k (1 - p)^(n - k)`` (Robbins, Ann. Math. Statist. 41, 1970; Howard,
  Ramdas, McAuliffe and Sekhon, Ann. Statist. 49, 2021).
"""

import math
from collections.abc import Callable
from functools import cache
from itertools import count

GOOD = 0.9
"""Proportion of twins on which a plan ends well above which no advice is given; chosen."""
WELL, BADLY = 0.95, 0.85
"""Proportions between which the test may end either way; chosen."""
ERROR = 0.05
"""Probability of the wrong end at either of them, at most (up to what the steps of the ratio overshoot, Wald 1947)."""
_UP, _DOWN = math.log(WELL / BADLY), math.log((1.0 - WELL) / (1.0 - BADLY))
_BOUND = math.log((1.0 - ERROR) / ERROR)


def is_certain(well: int, of: int) -> bool:
    """Whether the test has ended after ``of`` draws, of which ``well`` ended well."""
    return abs(well * _UP + (of - well) * _DOWN) >= _BOUND


def fewest_further(well: int, of: int) -> int:
    """Number of further draws after which the test has ended if all of them end well; at least 1.

    No more are begun at a time: those that are under way when the test ends are made for nothing.
    """
    return next(more for more in count(1) if is_certain(well + more, of + more))


def unbiased(well: int, of: int) -> float:
    """Estimate of the proportion where the test ended, or where its draws were at an end; NaN without draws."""
    if of == 0:
        return math.nan
    return _paths(well, of, 1) / _paths(well, of, 0)


def _paths(well: int, of: int, first: int) -> int:
    """Number of orders of successes and failures that lead to an end, those that begin with a success if ``first`` is 1."""
    counts = {1: 1} if first else {0: 1, 1: 1}
    for draws in range(1, of):
        later: dict[int, int] = {}
        for k, ways in counts.items():
            if not is_certain(k, draws):
                later[k] = later.get(k, 0) + ways
                later[k + 1] = later.get(k + 1, 0) + ways
        counts = later
    return counts.get(well, 0)


@cache
def interval(count: int, of: int) -> tuple[float, float]:
    """95 % interval of a proportion, whatever ended the draws."""
    if of == 0:
        return 0.0, 1.0
    rest = of - count
    mixed = math.lgamma(count + 0.5) + math.lgamma(rest + 0.5) - math.lgamma(of + 1.0) - math.log(math.pi)

    def outside(p: float) -> bool:
        likelihood = (count * math.log(p) if count else 0.0) + (rest * math.log1p(-p) if rest else 0.0)
        return mixed - likelihood >= math.log(20.0)

    middle = count / of
    low = 0.0 if count == 0 else _border(outside, 0.0, middle)
    high = 1.0 if rest == 0 else _border(outside, 1.0, middle)
    return low, high


def _border(outside: Callable[[float], bool], far: float, inside: float) -> float:
    for _ in range(60):
        middle = 0.5 * (far + inside)
        if outside(middle):
            far = middle
        else:
            inside = middle
    return far
