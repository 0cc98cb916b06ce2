"""What all tests share."""

import gc
import os
import uuid

# One thread for linear algebra, before numpy is imported. The matrices of the tests are small: on a busy machine threads that
# wait for each other make an identification ten times slower.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# One job where a command takes one for each core: pytest's workers have the cores already, and a worker of joblib takes two
# seconds of a processor to load the product. A test of several jobs asks for them.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")

from pathlib import Path

import pytest
from hypothesis import settings
from joblib.externals.loky import reusable_executor

from tests import forking
from tests.running import in_order, keep_bytecode, use_memory_for_files, workers
from tests.sharing import shared_folder
from tests.studies.installed import install_studies

keep_bytecode()
use_memory_for_files()
shared_folder()  # before workers are started, which then share it
install_studies()
forking.install()

pytest_plugins = ["tests.changed.plugin", "tests.command", "tests.browsing"]

# Shared machines and the first compilation of a kernel make any deadline a coin toss; speed is measured in benchmarks/.
# Examples are the same on every machine and in every run: what one finds is found again. HYPOTHESIS_SEARCH=1 seeks others.
settings.register_profile(
    "repeatable", deadline=None, print_blob=True, derandomize="HYPOTHESIS_SEARCH" not in os.environ
)
settings.load_profile("repeatable")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    return workers()


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect without looking for garbage: what is made stays to the end. The tests' garbage is then sought beside it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    in_order(items)


@pytest.fixture(scope="session", autouse=True)
def runs_of_the_tests_alone(tmp_path_factory):
    """Runs publish themselves where no other run of the user does, in this process and in those that it starts."""
    before = os.environ.get("VIBROLOCK_LIVE")
    folder = tmp_path_factory.mktemp("live")
    folder.chmod(0o700)
    os.environ["VIBROLOCK_LIVE"] = str(folder)
    yield folder
    os.environ.pop("VIBROLOCK_LIVE")
    if before is not None:
        os.environ["VIBROLOCK_LIVE"] = before


@pytest.fixture(autouse=True)
def benches_that_no_test_has_run(monkeypatch, tmp_path_factory):
    """What is remembered of benches, their trips above all, is a test's own, and nothing is kept in the user's folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.getbasetemp() / "state" / uuid.uuid4().hex))


@pytest.fixture(autouse=True)
def workers_stand_in_no_folder_that_goes():
    """Worker processes that a test has started in a folder of its own end with it; the next test's would find none."""
    here = Path.cwd()
    yield
    executor = reusable_executor._executor
    if executor is not None and any(_folder_of(worker) != here for worker in [*(executor._processes or ())]):
        executor.shutdown()


def _folder_of(process: int) -> Path | None:
    """The folder in which a process stands; None if it is gone, or cannot be asked on this system."""
    try:
        return Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return None
