"""Calls in the workers of joblib, whose results are taken as they come; who has enough may stop."""

import warnings
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

Result = TypeVar("Result")


def results_of(
    calls: Iterable[tuple[Callable[..., Result], Any, Any]], **options: Any
) -> Generator[Result, None, None]:
    """Yield the results of calls (each a `joblib.delayed`), with the ``options`` of `joblib.Parallel`.

    If the iterator is closed early, calls that have not begun are dropped. joblib then warns that work was lost; whoever closes
    it has all that it needs.
    """
    from joblib import Parallel  # only on use: it takes long to load

    found = Parallel(**options)(calls)
    try:
        yield from (one for one in found)  # which does not close it
    finally:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r".*\btasks\b", UserWarning)
            found.close()
