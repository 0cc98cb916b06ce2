"""Linear algebra is limited to one thread for as long as it is asked for."""

import subprocess
import sys

import scipy
from threadpoolctl import threadpool_info, threadpool_limits

from vibrolock.one_thread import one_thread


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_one_thread_is_used_inside_and_as_many_as_before_after():
    _ = scipy.linalg.eigh
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        with one_thread():
            assert threads() == {1}
        assert threads() == before


def test_as_a_decorator_it_holds_while_the_function_runs():
    assert one_thread()(threads)() == {1}


def test_a_virtual_rig_is_opened_without_loading_scipy():
    code = (
        "import sys; from rig.bench import load_bench; from rig.drivers import make_daq; "
        "daq = make_daq(load_bench('magnet-beam')); daq.open(); daq.start(1); daq.close(); "
        "print('scipy.linalg' in sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert answer.stdout.split() == ["False"]
