"""Many models: every job is a result, in processes or not, and finished ones are not done again."""

import pytest
from joblib import parallel_config

from identification import IdentificationError, identify_many, realisation_combinations
from tests.identification.pnlss.studies import identify_by_name, realisations


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
    with pytest.raises(IdentificationError, match="is there twice"):
        list(identify_many((*jobs, jobs[0]), identify_by_name))
