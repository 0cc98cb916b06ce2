"""Tunings of shipped benches that several tests begin from: made once for all tests and workers, and only read."""

import pickle
from dataclasses import replace
from functools import cache

from rig.tuning import Tuning, tune
from tests.sharing import made_once, shared_folder


@cache
def tuned_once(name: str) -> Tuning:
    """The tuning of a shipped bench, with its recording; nobody writes to either."""
    folder = made_once(shared_folder() / "tuned" / name, lambda folder: _tune(name, folder))
    return replace(pickle.loads((folder / "tuning.pickle").read_bytes()), recording=folder / "test.h5")


def _tune(name, folder):
    (folder / "tuning.pickle").write_bytes(pickle.dumps(tune(name, folder / "test.h5")))
