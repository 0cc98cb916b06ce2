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
        for old, new in (("modes", "linear_modes"), ("allow_extrapolation", "largest_range_use")):
            if old not in how:
                continue
            hint = ", `inf` allows any" if old == "allow_extrapolation" else ""
            warnings.warn(f"`{old}` of {function.__name__} is now `{new}`{hint}", DeprecationWarning, stacklevel=2)
            value = how.pop(old)
            if old == "modes":
                how[new] = value
            elif value:
                how[new] = float("inf")
        return function(*args, **how)

    return call
