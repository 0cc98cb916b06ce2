"""Many rigs in parallel: parameter studies, and Monte Carlo over seeds and scatter.

The work goes through joblib, whose backend is the user's choice in one line::

    from joblib import parallel_config
    with parallel_config(backend="dask"):
        for name, damping in ensemble(rigs, damping_of):
            ...

Rigs and functions are sent to the workers, and results come back. Nothing else is kept, so that memory does not grow with the
number of rigs if results are small and consumed as they arrive.
"""

from collections.abc import Callable, Generator, Iterable, Mapping
from typing import TypeVar

from joblib import delayed

from vibrolock.in_workers import results_of

__all__ = ["VariantError", "ensemble"]

Variant = TypeVar("Variant")
Result = TypeVar("Result")


class VariantError(RuntimeError):
    """The function failed for one variant; the message names the variant and the error."""


def ensemble(
    variants: Mapping[str, Variant] | Iterable[Variant],
    function: Callable[[Variant], Result],
    *,
    n_jobs: int | None = None,
) -> Generator[tuple[str, Result], None, None]:
    """Yield ``(name, function(variant))`` for every variant, in their order, as results arrive.

    Raises `VariantError`, naming the variant, if the function fails. After such an error, or if the iterator is closed early,
    the variants that the workers hold are waited for, at most two for each, and the others are dropped. Ctrl-C ends all.

    Parameters
    ----------
    variants
        Rigs, seeds, benches, or other arguments of the function: a mapping from names, or any iterable, whose items are
        named by counting from "0" and are taken only as workers become free.
    function
        Called with each variant. With joblib's own backend it runs in other processes; it should return the wanted results
        of a run, not the run.
    n_jobs
        As in joblib: a number of workers, -1 for all cores, None for the setting of `joblib.parallel_config`, or else 1.
    """
    named = variants.items() if isinstance(variants, Mapping) else enumerate(variants)
    calls = (delayed(_outcome)(function, str(name), variant) for name, variant in named)
    return results_of(calls, n_jobs=n_jobs, return_as="generator")


def _outcome(function: Callable[[Variant], Result], name: str, variant: Variant) -> tuple[str, Result]:
    try:
        return name, function(variant)
    except Exception as error:
        raise VariantError(f"variant {name}: {type(error).__name__}: {error}") from error
