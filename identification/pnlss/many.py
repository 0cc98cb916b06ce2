"""Many models at once: choice of their training, validation and test data, and one job each, in processes or on a cluster.

The work goes through joblib, whose backend is the user's choice in one line::

    from joblib import parallel_config
    with parallel_config(backend="dask"):
        for model in identify_many(jobs, partial(identify_pnlss, states=2)):
            ...

A fit is mostly small matrices and compiled loops on one core, so that models in parallel gain more than BLAS threads
within one: ``parallel_config("loky", inner_max_num_threads=1)`` avoids that both compete for cores.
"""

import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from joblib import Parallel, delayed

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment, same_data

__all__ = ["MIXED", "IdentifiedModel", "ModelJob", "identify_many", "realisation_combinations"]

MIXED = "mixed"
"""Name of the training set that holds all levels."""
_FEWEST = 3

Fit = TypeVar("Fit")


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelJob:
    """Experiments from which one model of a study is identified.

    Parameters
    ----------
    name
        Name of the model, unique within a study.
    training_set
        The level at which it is trained, or ``mixed``.
    training
        Experiments that are fitted.
    validation
        Experiments that choose the iterate and are not fitted.
    left_out
        Experiments that the identification never sees; they give the same-level error.
    """

    name: str
    training_set: str
    training: tuple[Experiment, ...]
    validation: tuple[Experiment, ...]
    left_out: tuple[Experiment, ...]

    def seen(self, experiment: Experiment) -> bool:
        """Whether the identification uses the samples of this experiment, for training or validation."""
        return any(same_data(experiment, own) for own in (*self.training, *self.validation))


def realisation_combinations(
    levels: Mapping[str, Sequence[Experiment]],
    *,
    models: int | Mapping[str, int],
    mixed: bool = True,
    most: int | None = None,
    beside: Sequence[Experiment] = (),
    beside_validation: Sequence[Experiment] = (),
) -> tuple[ModelJob, ...]:
    """Jobs of different combinations of the realisations of each level, and of all levels together.

    Every model leaves one realisation out for its test and is identified from all others (four of five, nine of ten, as in
    Scheel et al., Section 3.3), one of which chooses the iterate and is not fitted. The paper does not say how five
    realisations give twenty models; there are just twenty ordered pairs of a realisation left out and one that chooses (ninety
    of ten realisations, of which the paper used thirty). So model k of R realisations leaves out ``k mod R``; after every R
    models the choosing realisation moves on by one. The first R models leave out different realisations, and all ``R (R - 1)``
    models differ.

    Parameters
    ----------
    levels
        Realisations by level, from the lowest level to the highest.
    models
        Number of models of each training set, or one number for each name, ``mixed`` among them; 0 for none.
    mixed
        Whether there is a training set ``mixed`` of all levels, whose model k takes combination k of each level.
    most
        Largest number of realisations of each level that a model is fitted to, to save time: those that follow the choosing
        one. None for all.
    beside, beside_validation
        Further experiments that every model fits, such as backbone segments, and further ones that help to choose its
        iterate. Without the latter, realisations of a low level choose an iterate that ignores segments of high level.

    Raises
    ------
    IdentificationError
        With fewer than three realisations, none to be fitted, more models than combinations, a level called ``mixed``, no
        level or no model.
    """
    if most is not None and most < 1:
        raise IdentificationError(f"most: is {most}, allowed are 1 and above, or None for all realisations")
    if MIXED in levels or not levels:
        raise IdentificationError(
            f"levels: {', '.join(levels) or 'none given'}; needs one at least, none called {MIXED}"
        )
    for level, realisations in levels.items():
        if len(realisations) < _FEWEST:
            raise IdentificationError(
                f"levels: {len(realisations)} realisations at {level}, needs {_FEWEST} at least: one to fit, one to choose the "
                "iterate, one to test"
            )
    sets = {level: {level: levels[level]} for level in levels} | ({MIXED: dict(levels)} if mixed else {})
    if not isinstance(models, int):
        unknown = [name for name in models if name not in sets]
        if unknown:
            raise IdentificationError(f"models: there is no training set {unknown[0]}, known are {', '.join(sets)}")
    jobs: list[ModelJob] = []
    for training_set, members in sets.items():
        count = models if isinstance(models, int) else models.get(training_set, 0)
        possible = max(len(r) * (len(r) - 1) for r in members.values())
        if not 0 <= count <= possible:
            raise IdentificationError(
                f"models: {count} of {training_set}, allowed are 0 to {possible} different combinations"
            )
        for k in range(count):
            job = _job(training_set, members, k, most)
            training, validation = (*job.training, *beside), (*job.validation, *beside_validation)
            jobs.append(replace(job, training=training, validation=validation))
    if not jobs:
        raise IdentificationError("models: are 0, needs one at least")
    return tuple(jobs)


def _job(training_set: str, members: Mapping[str, Sequence[Experiment]], k: int, most: int | None) -> ModelJob:
    """Job of combination k of the realisations of every level."""
    training: list[Experiment] = []
    validation: list[Experiment] = []
    left_out: list[Experiment] = []
    for realisations in members.values():
        count = len(realisations)
        tests = k % count
        chooses = (tests + 1 + k // count % (count - 1)) % count
        left_out.append(realisations[tests])
        validation.append(realisations[chooses])
        others = [index for step in range(1, count) if (index := (chooses + step) % count) != tests]
        training += [realisations[index] for index in sorted(others[:most])]
    return ModelJob(
        name=f"{training_set} {k + 1:02d}",
        training_set=training_set,
        training=tuple(training),
        validation=tuple(validation),
        left_out=tuple(left_out),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModel(Generic[Fit]):
    """Result of a job.

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
    """Yield the models of all jobs in the order in which they finish.

    ``identify`` is called as ``identify(training, validation=...)`` with the job's experiments, in another process where
    there are several: `identification.identify_pnlss` with all else bound by `functools.partial`. ``n_jobs`` as in
    joblib: a number of workers, -1 for all cores; None for what `joblib.parallel_config` says, else 1. Jobs whose names are
    in ``done`` are skipped, so that an interrupted study can be continued from its stored results. ``progress``
    is called with each result, the number of those finished and that of all.

    A failed job gives a result with its reason, and the others continue. After Ctrl-C, or if the iterator is closed early,
    jobs that have not started are dropped. Raises `IdentificationError` if two jobs have the same name.
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
