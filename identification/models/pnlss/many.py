"""Identify many models: choose their training, validation and test data, and run one job each, in processes or on a cluster.

The work goes through joblib, whose backend the user selects in one line::

    from joblib import parallel_config

    with parallel_config(backend="dask"):
        for model in identify_many(jobs, partial(identify_pnlss, states=2)):
            ...

A fit uses as many threads as the linear algebra, but not all of an iteration gains by them. Models in parallel therefore gain
more; ``parallel_config("loky", inner_max_num_threads=1)`` keeps the two from competing for cores.
"""

import contextlib
import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from joblib import delayed

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, same_data
from vibrolock.in_workers import results_of

MIXED = "mixed"
"""Name of the training set that holds all levels."""
_FEWEST = 3  # realisations of a level: one to fit, one to choose the iterate, one to test

Fit = TypeVar("Fit")


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelJob:
    """Experiments from which one model of a study is identified.

    Parameters
    ----------
    name
        Name of the model, unique within a study.
    training_set
        The level at which the model is trained, or ``mixed``.
    training
        Experiments that are fitted.
    validation
        Experiments that select the iterate and are not fitted.
    left_out
        Experiments that the identification does not use; they give the same-level error.
    """

    name: str
    training_set: str
    training: tuple[Experiment, ...]
    validation: tuple[Experiment, ...]
    left_out: tuple[Experiment, ...]

    def seen(self, experiment: Experiment) -> bool:
        """Return whether the identification uses the samples of this experiment, for training or validation."""
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
    """Return jobs with different combinations of the realisations of each level, and of all levels together.

    Every model leaves one realisation out for its test and is identified from all others (four of five, nine of ten, as in
    Scheel et al., Section 3.3). One of these others selects the iterate and is not fitted. The paper does not state how five
    realisations give twenty models, but there are exactly twenty ordered pairs of a realisation left out and one that selects
    (ninety for ten realisations, of which the paper used thirty). Model k of R realisations therefore leaves out ``k mod R``,
    and after every R models the selecting realisation advances by one. The first R models leave out different realisations,
    and all ``R (R - 1)`` models differ.

    Raises `IdentificationError` if there are fewer than three realisations, none to fit, more models than combinations, a
    level called ``mixed``, no level or no model.

    Parameters
    ----------
    levels
        Realisations by level, from the lowest level to the highest.
    models
        Number of models of each training set, or numbers by the names of training sets, including ``mixed``; 0 for none.
    mixed
        Whether there is a training set ``mixed`` of all levels, whose model k takes combination k of each level.
    most
        Largest number of realisations per level to which a model is fitted, to save time; those after the selecting
        realisation are used. None for all.
    beside, beside_validation
        Further experiments to which every model is fitted, such as backbone segments, and further ones that help to select
        its iterate. Without the latter, realisations of a low level would select an iterate regardless of high-level
        segments.
    """
    if most is not None and most < 1:
        raise IdentificationError(field="most", value=most, allowed="1 and above, or None for all realisations")
    if MIXED in levels or not levels:
        raise IdentificationError(
            ", ".join(levels) or "none given", field="levels", allowed=f"one at least, none called {MIXED}"
        )
    for level, realisations in levels.items():
        if len(realisations) < _FEWEST:
            raise IdentificationError(
                f"{len(realisations)} realisations at {level}",
                field="levels",
                allowed=f"{_FEWEST} at least: one to fit, one to choose the iterate, one to test",
            )
    sets = {level: {level: levels[level]} for level in levels} | ({MIXED: dict(levels)} if mixed else {})
    if not isinstance(models, int):
        unknown = [name for name in models if name not in sets]
        if unknown:
            raise IdentificationError(f"there is no training set {unknown[0]}", field="models", allowed=sets)
    jobs: list[ModelJob] = []
    for training_set, members in sets.items():
        count = models if isinstance(models, int) else models.get(training_set, 0)
        possible = max(len(r) * (len(r) - 1) for r in members.values())
        if not 0 <= count <= possible:
            raise IdentificationError(
                f"{count} of {training_set}", field="models", allowed=f"0 to {possible} different combinations"
            )
        for k in range(count):
            job = _job(training_set, members, k, most)
            training, validation = (*job.training, *beside), (*job.validation, *beside_validation)
            jobs.append(replace(job, training=training, validation=validation))
    IdentificationError.raise_if(not jobs, "are 0", field="models", allowed="one at least")
    return tuple(jobs)


def _job(training_set: str, members: Mapping[str, Sequence[Experiment]], k: int, most: int | None) -> ModelJob:
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
        Name and training set of the job.
    fit
        The result; None if the identification failed.
    reason
        Why it failed; empty if it did not.
    seconds
        Wall time of the job.
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

    Parameters
    ----------
    jobs
        The jobs, each with a name of its own.
    identify
        Called as ``identify(training, validation=...)`` with the job's experiments, in another process if there are several
        workers. It is usually `identification.identify_pnlss` with its other arguments bound by `functools.partial`.
    n_jobs
        Number of workers as in joblib: -1 for all cores; None for the setting of `joblib.parallel_config`, else 1.
    done
        Names of jobs that are skipped, so that an interrupted study can be continued from its stored results.
    progress
        Called with each result, the number of finished jobs and the number of all jobs.

    Notes
    -----
    A failed job gives a result with its reason, and the others continue. If the iterator is closed early, jobs that the
    workers hold are waited for, at most two for each, and the others are dropped; Ctrl-C ends all. Raises
    `IdentificationError` if two jobs have the same name.
    """
    given = list(jobs)
    names = [job.name for job in given]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise IdentificationError(f"the name '{twice}' is there twice", field="jobs")
    left = [job for job in given if job.name not in done]
    calls = (delayed(_outcome)(identify, job) for job in left)
    # A worker holds its present job and one more, and results are yielded at once: memory does not grow with the study.
    found = results_of(calls, n_jobs=n_jobs, return_as="generator_unordered")
    with contextlib.closing(found):
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
