"""Workers of joblib may be given something to do while the process that has them does something else."""

from functools import partial
from pathlib import Path
from uuid import uuid4

import pytest

from vibrolock.in_workers import meanwhile


def note(folder: Path) -> None:
    """Leave a file for each call."""
    (folder / uuid4().hex).touch()


def test_each_worker_has_called_the_function_at_the_end(tmp_path):
    with meanwhile(partial(note, tmp_path), 2):
        pass
    assert len(list(tmp_path.iterdir())) == 2


def test_with_one_job_nothing_is_called(tmp_path):
    with meanwhile(partial(note, tmp_path), 1):
        pass
    assert not list(tmp_path.iterdir())


def test_an_error_meanwhile_is_raised_once_the_workers_have_called_it(tmp_path):
    with pytest.raises(ValueError, match="of its own"), meanwhile(partial(note, tmp_path), 2):
        raise ValueError("of its own")
    assert len(list(tmp_path.iterdir())) == 2
