"""Keywords that had another name."""

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def formerly(function: Callable[P, T]) -> Callable[P, T]:
    """Accept the former keywords ``modes`` and ``allow_extrapolation``, with a `DeprecationWarning` that says the new one."""

    @functools.wraps(function)
    def call(*args: P.args, **how: P.kwargs) -> T:
        for old, new in (("modes", "`linear_modes`"), ("allow_extrapolation", "`largest_range_use`, `inf` allows any")):
            if old in how:
                warnings.warn(f"`{old}` of {function.__name__} is now {new}", DeprecationWarning, stacklevel=2)
        if "modes" in how:
            how["linear_modes"] = how.pop("modes")
        if how.pop("allow_extrapolation", False):
            how["largest_range_use"] = float("inf")
        return function(*args, **how)

    return call
