"""Which realisations train a model, which choose its iterate, and which are left to test it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment
from identification.pnlss.experiment_groups import same_data

__all__ = ["MIXED", "ModelJob", "realisation_combinations"]

MIXED = "mixed"
"""Name of the training set that holds all levels."""
_FEWEST = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelJob:
    """What one model of a study is identified from.

    Parameters
    ----------
    name
        Name of the model, unique within a study.
    training_set
        The level that it is trained at, or ``mixed``.
    training
        Fitted.
    validation
        Not fitted: they choose the iterate.
    left_out
        Never seen by the identification: they give the same-level error.
    """

    name: str
    training_set: str
    training: tuple[Experiment, ...]
    validation: tuple[Experiment, ...]
    left_out: tuple[Experiment, ...]

    def seen(self, experiment: Experiment) -> bool:
        """Whether the identification knows the samples of this experiment, be it to fit or to choose."""
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

    Every model leaves one realisation out, for its test, and identifies from all others (four of five, nine of ten, as
    Scheel et al., Section 3.3): of these one chooses the iterate and is not fitted. The paper does not say how twenty models
    come of five realisations; the ordered pairs of a realisation left out and one that chooses are just twenty (of ten
    ninety, of which the paper then used thirty). So model k of R realisations leaves out ``k mod R``, and every R models the
    one that chooses moves on by one. The first R models differ in what is left out, and none of ``R (R - 1)`` is there twice.

    Parameters
    ----------
    levels
        Realisations by level, from the lowest level to the highest.
    models
        Number of models of each training set, or one number for each name, ``mixed`` among them; 0 for none.
    mixed
        Whether there is a training set ``mixed`` of all levels concatenated: of each level combination k.
    most
        Realisations of each level that a model is fitted to, at most, where all others would take too long: those that follow
        the one that chooses. None for all.
    beside, beside_validation
        Further experiments that are fitted by every model, backbone segments for instance, and further ones that help to
        choose its iterate: without, realisations of a low level choose one that knows nothing of high segments.

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
    """Combination k."""
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
