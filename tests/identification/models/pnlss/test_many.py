"""Many models: which realisations train, choose and test them; every job is a result, in processes or not, and not repeated."""

from itertools import permutations

import pytest
from joblib import parallel_config

from identification import IdentificationError, identify_many, realisation_combinations
from tests.identification.models.pnlss.studies import identify_by_name, realisations
from tests.refused import refused


@pytest.fixture
def jobs():
    return realisation_combinations({"low": realisations(0.5, 5)}, models=5, mixed=False)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_job_that_fails_is_a_result_with_its_reason_and_the_others_go_on(jobs, n_jobs):
    found = {model.name: model for model in identify_many(jobs, identify_by_name, n_jobs=n_jobs)}
    assert set(found) == {job.name for job in jobs}
    for job in jobs:
        model = found[job.name]
        if job.training[0].name.endswith(" 0"):
            names = tuple(one.name for one in job.training), tuple(one.name for one in job.validation)
            assert (model.fit, model.reason) == (names, "")
        else:
            assert model.fit is None
    reasons = {model.reason for model in found.values()}
    assert reasons == {"", "training: cannot be fitted", "ZeroDivisionError: by accident"}


def test_what_is_done_is_not_done_again_and_counts_in_the_progress(jobs):
    done = {jobs[0].name, jobs[3].name}
    told = []
    found = list(
        identify_many(jobs, identify_by_name, done=done, progress=lambda m, n, of: told.append((m.name, n, of)))
    )
    assert {model.name for model in found} == {job.name for job in jobs} - done
    assert [(n, of) for _, n, of in told] == [(3, 5), (4, 5), (5, 5)]


def test_the_backend_is_the_callers_choice_in_one_line(jobs):
    with parallel_config(backend="threading", n_jobs=2):
        found = list(identify_many(jobs, identify_by_name))
    assert len(found) == 5


def test_two_jobs_of_one_name_are_refused(jobs):
    with refused(IdentificationError, "is-there-twice", field="jobs"):
        list(identify_many((*jobs, jobs[0]), identify_by_name))


def split_of(job):
    return tuple(tuple(one.name for one in part) for part in (job.training, job.validation, job.left_out))


def test_five_realisations_give_the_twenty_models_of_the_paper_each_ordered_pair_once():
    low = realisations(0.5, 5)
    jobs = realisation_combinations({"low": low}, models=20, mixed=False)
    pairs = {(job.left_out[0].name, job.validation[0].name) for job in jobs}
    assert pairs == set(permutations([one.name for one in low], 2))
    for job in jobs:
        train, choose, test = split_of(job)
        assert len(train) == 3
        assert sorted(train + choose + test) == sorted(one.name for one in low)
    with refused(IdentificationError, "of-low", field="models", allowed="0 to 20 different combinations"):
        realisation_combinations({"low": low}, models=21, mixed=False)


def test_the_first_models_leave_out_every_realisation_once():
    jobs = realisation_combinations({"low": realisations(0.5, 10)}, models=10, mixed=False)
    assert len({job.left_out[0].name for job in jobs}) == 10


def test_mixed_models_hold_all_levels_and_leave_out_one_of_each():
    levels = {"low": realisations(0.5, 5), "high": realisations(2.0, 10)}
    beside = realisations(1.0, 1)
    chooses = realisations(1.5, 1)
    jobs = realisation_combinations(levels, models={"mixed": 30, "high": 2}, beside=beside, beside_validation=chooses)
    assert [job.training_set for job in jobs] == ["high"] * 2 + ["mixed"] * 30
    mixed = jobs[2:]
    assert len({split_of(job) for job in mixed}) == 30
    for job in mixed:
        assert (len(job.training), len(job.validation), len(job.left_out)) == (3 + 8 + 1, 2 + 1, 2)
        assert job.training[-1] is beside[0]
        assert job.validation[-1] is chooses[0]
        assert not any(job.seen(one) for one in job.left_out)
        assert all(job.seen(one) for one in job.validation)
    assert len({job.name for job in jobs}) == len(jobs)


def test_fewer_realisations_can_be_fitted_and_all_take_their_turn():
    levels = {"low": realisations(0.5, 5), "high": realisations(2.0, 10)}
    jobs = realisation_combinations(levels, models={"high": 10, "mixed": 1}, most=4)
    for job in jobs[:10]:
        assert len(job.training) == 4
        assert len({*split_of(job)[0], *split_of(job)[1], *split_of(job)[2]}) == 6
    fitted = [name for job in jobs[:10] for name in split_of(job)[0]]
    assert {fitted.count(name) for name in fitted} == {4}
    assert len(jobs[10].training) == 3 + 4
    with refused(IdentificationError, field="most", value=0, allowed="1 and above, or None for all realisations"):
        realisation_combinations(levels, models=1, most=0)


@pytest.mark.parametrize(
    ("levels", "models", "said"),
    [
        ({}, 1, {"says": "none-given", "field": "levels"}),
        ({"mixed": 3}, 1, {"says": "none-called-mixed", "field": "levels"}),
        ({"low": 2}, 1, {"says": "realisations-at-low", "field": "levels"}),
        ({"low": 3}, {"high": 1}, {"says": "there-is-no-training-set-high", "field": "models"}),
        ({"low": 3}, 0, {"says": "are", "field": "models"}),
    ],
)
def test_what_cannot_be_combined_is_said(levels, models, said):
    given = {name: realisations(0.5, count) for name, count in levels.items()}
    with refused(IdentificationError, **said):
        realisation_combinations(given, models=models)
