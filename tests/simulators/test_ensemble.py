import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joblib import parallel_config

from simulators.ensemble import VariantError, ensemble
from simulators.simulation import Simulation
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.waiting import LONG_S, wait_until
from vibrolock.content_cache import c_function


@c_function("float64(float64, CPointer(float64))")
def hardening(z: float, parameters: Any) -> float:
    return float(-parameters[0] * z**3)


def drive_rms(rig: VirtualRig) -> float:
    return float(np.std(Simulation(rig).run(np.sin(0.03 * np.arange(500))).measured["drive"]))


def square(value: float) -> float:
    return value**2


def reciprocal(value: float) -> float:
    return 1.0 / value


def process(_: int) -> int:
    return os.getpid()


def test_rigs_give_in_other_processes_what_they_give_here() -> None:
    rigs = {f"seed {k}": VirtualRig.shipped("magnet-beam", seed=k, scatter={"frequency": 1e-3}) for k in range(6)}
    parallel = list(ensemble(rigs, drive_rms, n_jobs=2))
    assert parallel == [(name, drive_rms(rig)) for name, rig in rigs.items()]
    assert len({result for _, result in parallel}) == 6


def test_results_are_named_by_counting_where_no_names_are_given() -> None:
    assert list(ensemble([3.0, 4.0], square)) == [("0", 9.0), ("1", 16.0)]


def test_who_has_enough_stops_without_a_warning() -> None:
    found = ensemble(count(), process, n_jobs=2)
    next(found)
    found.close()  # warnings are errors in tests


@pytest.mark.skipif(sys.platform == "win32", reason="signal 0 ends a process there")
def test_closing_it_or_a_failing_variant_keeps_the_workers() -> None:
    found = ensemble(range(200), process, n_jobs=2)
    _, worker = next(found)
    found.close()
    os.kill(worker, 0)
    with pytest.raises(VariantError, match="ZeroDivisionError") as failed:
        list(ensemble([1.0, 0.0] * 50, reciprocal, n_jobs=2))
    os.kill(worker, 0)
    assert "in reciprocal" in failed.value.__notes__[0]


def test_backend_of_the_user_is_honoured() -> None:
    with parallel_config(backend="threading", n_jobs=2):
        here = {result for _, result in ensemble(range(8), process)}
    with parallel_config(backend="loky", n_jobs=2):
        elsewhere = {result for _, result in ensemble(range(8), process)}
    assert here == {os.getpid()}
    assert os.getpid() not in elsewhere


def test_variants_are_taken_as_workers_come_free_and_not_all_at_once() -> None:
    taken = []

    def counted() -> Iterator[float]:
        for k in range(10_000):
            taken.append(k)
            yield float(k)

    results = ensemble(counted(), square, n_jobs=1)
    assert next(results) == ("0", 0.0)
    assert len(taken) < 100
    results.close()
    assert len(taken) < 100


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_failing_variant_is_named(n_jobs: int) -> None:
    with refused(VariantError, "variant-stiff-zerodivisionerror-float-division-by"):
        list(ensemble({"soft": 2.0, "stiff": 0.0}, reciprocal, n_jobs=n_jobs))


SLEEPER = """
import os, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job begins with it ignored
from simulators.ensemble import ensemble

def slow(value):
    os.write(1, b"begun\\n")  # whole, whatever the other worker writes
    time.sleep(60.0)

if __name__ == "__main__":
    list(ensemble(range(50), slow, n_jobs=2))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT for a group of processes")
def test_interrupt_ends_it_and_leaves_no_worker(tmp_path: Path) -> None:
    script = tmp_path / "sleeper.py"
    script.write_text(SLEEPER)
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == "begun\n"
        os.killpg(running.pid, signal.SIGINT)
        assert running.wait(LONG_S) != 0
        wait_until(lambda: not _group_is_alive(running.pid), "end of the workers")


def _group_is_alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_function_that_was_given_as_an_object_is_found_in_other_processes() -> None:
    element = {"kind": "user", "at": "tip", "function": hardening, "parameters": [1e9]}
    rig = VirtualRig.shipped("magnet-beam", elements=[element])
    assert [result for _, result in ensemble([rig, rig], drive_rms, n_jobs=2)] == [drive_rms(rig)] * 2
