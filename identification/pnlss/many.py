"""Many models at once: one job each, in processes or on a cluster.

The work goes through joblib, whose backend is the user's choice in one line::

    from joblib import parallel_config
    with parallel_config(backend="dask"):
        for model in identify_many(jobs, partial(identify_pnlss, states=2)):
            ...

A fit is mostly small matrices and compiled loops on one core, so that models in parallel gain more than BLAS threads
within one: ``parallel_config("loky", inner_max_num_threads=1)`` keeps the two from fighting for cores.
"""

import time
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from joblib import Parallel, delayed

from identification.errors import IdentificationError
from identification.pnlss.model_jobs import ModelJob

__all__ = ["IdentifiedModel", "identify_many"]

Fit = TypeVar("Fit")


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModel(Generic[Fit]):
    """What came of a job.

    Parameters
    ----------
    name, training_set
        Those of the job.
    fit
        The result; None if the identification failed.
    reason
        Why it failed; empty if it did not.
    seconds
        Wall time of the job where it ran.
    """

    name: str
    training_set: str
    fit: Fit | None
    reason: str
    seconds: float


def identify_many(
    jobs: Iterable[ModelJob],
    identify: Callable[..., Fit],
    *,
    n_jobs: int | None = None,
    done: Container[str] = (),
    progress: Callable[[IdentifiedModel[Fit], int, int], None] | None = None,
) -> Iterator[IdentifiedModel[Fit]]:
    """Yield the models of all jobs as they are finished, in whatever order that is.

    ``identify`` is called as ``identify(training, validation=...)`` with the job's experiments, in another process where
    there are several: `identification.identify_pnlss` with all else bound by `functools.partial`. ``n_jobs`` as in
    joblib: a number of workers, -1 for all cores; None for what `joblib.parallel_config` says, else 1. Jobs whose names are
    in ``done`` are left out, so that a study whose results were kept as they came is taken up where it ended. ``progress``
    is called with each result, the number of those finished and that of all.

    A job that fails is a result with its reason, and the others go on. After Ctrl-C, and when the iterator is closed early,
    what has not begun is dropped. Raises `IdentificationError` where two jobs have the same name.
    """
    given = list(jobs)
    names = [job.name for job in given]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise IdentificationError(f"jobs: the name '{twice}' is there twice")
    left = [job for job in given if job.name not in done]
    calls = (delayed(_outcome)(identify, job) for job in left)
    # A worker holds the job it works on and one more, and results leave as they come: memory does not grow with the study.
    found = Parallel(n_jobs=n_jobs, return_as="generator_unordered", pre_dispatch="2*n_jobs", batch_size=1)(calls)
    for count, result in enumerate(found, len(given) - len(left) + 1):
        if progress is not None:
            progress(result, count, len(given))
        yield result


def _outcome(identify: Callable[..., Fit], job: ModelJob) -> IdentifiedModel[Fit]:
    begun = time.perf_counter()
    fit, reason = None, ""
    try:
        fit = identify(job.training, validation=job.validation)
    except IdentificationError as error:
        reason = str(error)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    return IdentifiedModel(
        name=job.name, training_set=job.training_set, fit=fit, reason=reason, seconds=time.perf_counter() - begun
    )
