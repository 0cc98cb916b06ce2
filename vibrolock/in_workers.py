"""Calls in the workers of joblib, whose results are taken as they come; who has enough may stop."""

import traceback
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from itertools import takewhile
from threading import Event
from typing import Any, Generic, NamedTuple, TypeVar

Result = TypeVar("Result")


class _Outcome(NamedTuple, Generic[Result]):
    result: Result | None
    error: Exception | None


def results_of(
    calls: Iterable[tuple[Callable[..., Result], Any, Any]], **options: Any
) -> Generator[Result, None, None]:
    """Yield the results of calls (each a `joblib.delayed`), with the ``options`` of `joblib.Parallel`.

    If a call fails, its error is raised, with the worker's traceback as a note. After an error, or if the iterator is closed
    early, no more calls are handed to the workers, and those that were are waited for: at most two for each worker. joblib
    itself would kill the workers. They would have to be started again for what comes next, and a call that is handed over at
    that moment ends the thread that manages them with an error. Ctrl-C while a result is waited for does kill them.
    """
    from joblib import Parallel  # only on use: it takes long to load

    enough = Event()
    wanted = takewhile(lambda _: not enough.is_set(), calls)
    found = Parallel(pre_dispatch="n_jobs", batch_size=1, **options)((_held, call, {}) for call in wanted)
    try:
        for result, error in found:
            if error is not None:
                raise error
            yield result
    finally:
        enough.set()
        for _ in found:
            pass


@contextmanager
def meanwhile(function: Callable[[], object], n_jobs: int | None = None) -> Iterator[None]:
    """Let each worker call a function, such as one that loads what its next calls need, while this process does something else.

    At its end the context waits for the workers, also after an error. ``n_jobs`` is that of the calls that follow; with one job
    nothing is called.
    """
    from joblib import Parallel, delayed, effective_n_jobs

    workers = effective_n_jobs(n_jobs)
    if workers == 1:
        yield
        return
    begun = Parallel(n_jobs=n_jobs, batch_size=1, return_as="generator")(delayed(function)() for _ in range(workers))
    try:
        yield
    finally:
        for _ in begun:
            pass


def _held(function: Callable[..., Result], given: Any, named: Any) -> _Outcome[Result]:
    """Return what a call returns or raises: an exception would let joblib kill the workers."""
    try:
        return _Outcome(function(*given, **named), None)
    except Exception as error:
        error.add_note(traceback.format_exc())
        return _Outcome(None, error)
