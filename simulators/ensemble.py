"""Many rigs in parallel: parameter studies, and Monte Carlo over seeds and scatter.

The work goes through joblib, whose backend is the user's choice in one line::

    from joblib import parallel_config
    with parallel_config(backend="dask"):
        for name, damping in ensemble(rigs, damping_of):
            ...

Rigs and functions are sent to the workers, results come back; nothing else is kept, so that memory does not grow with the
number of rigs as long as results are small and used as they come.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TypeVar

from joblib import Parallel, delayed

__all__ = ["VariantError", "ensemble"]

Variant = TypeVar("Variant")
Result = TypeVar("Result")


class VariantError(RuntimeError):
    """The function failed for one variant; the message names it, and what went wrong."""


def ensemble(
    variants: Mapping[str, Variant] | Iterable[Variant],
    function: Callable[[Variant], Result],
    *,
    n_jobs: int | None = None,
) -> Iterator[tuple[str, Result]]:
    """Yield ``(name, function(variant))`` for every variant, in their order, as results arrive.

    ``variants`` are rigs, seeds, benches, or whatever the function takes: a mapping from names, or any iterable, which
    then is named by counting from "0" and taken from only as workers come free. ``n_jobs`` as in joblib: a number of
    workers, -1 for all cores; None for what `joblib.parallel_config` says, else 1. The function runs in other processes
    (with joblib's own backend); it should return what is wanted of a run, not the run.

    Raises `VariantError` where the function fails, naming the variant. Then, after Ctrl-C and when the iterator is closed
    early, what has not begun is dropped.
    """
    named = variants.items() if isinstance(variants, Mapping) else enumerate(variants)
    calls = (delayed(_outcome)(function, str(name), variant) for name, variant in named)
    yield from Parallel(n_jobs=n_jobs, return_as="generator")(calls)


def _outcome(function: Callable[[Variant], Result], name: str, variant: Variant) -> tuple[str, Result]:
    try:
        return name, function(variant)
    except Exception as error:
        raise VariantError(f"variant {name}: {type(error).__name__}: {error}") from error
