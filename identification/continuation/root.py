"""Root of a function of one variable between two ends, by R. M. Chandrupatla's method (Adv. Eng. Software 28, 1997).

It is as sure as bisection and mostly as quick as inverse quadratic interpolation. SciPy's functions do the same; importing
`scipy.optimize` takes as long as a whole curve.
"""

import math
from collections.abc import Callable

_MOST = 100  # evaluations; bisection alone would take 52


def root_between(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float | None:
    """Return a root to within ``tolerance``; None if the signs at the ends are alike, or a value is not a number."""
    a, b = high, low
    of_a, of_b = function(a), function(b)
    if not of_a * of_b <= 0.0:
        return None
    c, of_c, share = b, of_b, 0.5
    for _ in range(_MOST):
        if of_a == 0.0 or of_b == 0.0:
            return a if of_a == 0.0 else b
        x = a + share * (b - a)
        of_x = function(x)
        if math.isnan(of_x):
            return None
        if (of_x > 0.0) == (of_a > 0.0):
            c, of_c = a, of_a
        else:
            c, of_c, b, of_b = b, of_b, a, of_a
        a, of_a = x, of_x
        least = tolerance / abs(b - a)
        if least > 0.5:
            break
        place, ratio = (a - b) / (c - b), (of_a - of_b) / (of_c - of_b)
        share = 0.5
        if ratio**2 < place and (1.0 - ratio) ** 2 < 1.0 - place:
            share = of_a / (of_b - of_a) * of_c / (of_b - of_c)
            share += (c - a) / (b - a) * of_a / (of_c - of_a) * of_b / (of_c - of_b)
        share = min(1.0 - least, max(least, share))
    return a if abs(of_a) < abs(of_b) else b
