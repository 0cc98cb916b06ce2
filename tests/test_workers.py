"""Worker processes of one test are not left to another in a folder that is gone."""

from pathlib import Path

import pytest
from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor


def stand(_: int) -> str:
    """The folder of the process that is asked."""
    return str(Path.cwd())


@pytest.mark.slow
def test_workers_may_be_started_in_a_folder_that_goes(tmp_path, monkeypatch):
    get_reusable_executor().shutdown()  # of tests before, in the folder of the tests
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert set(Parallel(n_jobs=2)(delayed(stand)(k) for k in range(4))) == {str(tmp_path / "here")}


def test_workers_after_it_stand_where_the_tests_do(tmp_path):
    assert set(Parallel(n_jobs=2)(delayed(stand)(k) for k in range(4))) == {str(Path.cwd())}
