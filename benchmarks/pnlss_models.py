"""What parallel models gain: ``python -m benchmarks.pnlss_models [--models N] [--json]``.

The same twenty models, of the lowest level of the virtual magnet beam, one after the other and two at a time, in one run;
and, where dask and distributed are installed, on a Dask cluster of two worker processes on this machine. Every worker has
one BLAS thread (``inner_max_num_threads`` of joblib, ``OMP_NUM_THREADS`` in Dask's workers by its own default): two workers
with two threads each would fight for two cores. The processes are started, and have compiled or loaded what they need,
before the clock is. Without parallel workers, too, one thread is used: say ``OMP_NUM_THREADS=1`` before the command.
"""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import typer
from joblib import parallel_config

import rig
from benchmarks.frame import show
from identification import FitSettings, identify_many, identify_pnlss, realisation_combinations
from rig.measurements.experiments import experiments

ITERATIONS = 30
"""Of every fit."""
WORKERS = 2
"""Processes at the same time."""


def jobs(count: int) -> tuple[Any, ...]:
    with rig.run("magnet-beam/multisine-1") as run:
        low = experiments(run.recording, outputs=("drive", "acc_magnet"), rate_hz=800.0)
    return realisation_combinations({"0.5 N": low}, models=count, mixed=False)


def seconds(work: Any, identify: Any, **how: Any) -> float:
    list(identify_many(work[:WORKERS], identify, **how))  # processes started, kernels loaded
    begun = time.perf_counter()
    found = list(identify_many(work, identify, **how))
    taken = time.perf_counter() - begun
    failed = [model.reason for model in found if model.fit is None]
    if failed:
        raise RuntimeError(failed[0])
    return taken


@contextmanager
def cluster() -> Iterator[Any]:
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=WORKERS, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as local,
        Client(local) as client,
    ):
        yield client


def measure(count: int) -> dict[str, float]:
    work = jobs(count)
    # No end but the last: every run then has the same work, whatever its luck with the data.
    settings = FitSettings(iterations=ITERATIONS, patience=0, tolerance=0.0)
    identify = partial(identify_pnlss, states=2, degrees=(2, 3), settings=settings)
    found = {"one": seconds(work, identify, n_jobs=1)}
    with parallel_config("loky", inner_max_num_threads=1):
        found["two"] = seconds(work, identify, n_jobs=WORKERS)
    try:
        import distributed  # noqa: F401
    except ImportError:
        return found
    with cluster(), parallel_config(backend="dask"):
        found["dask"] = seconds(work, identify)
    return found


def main(models: int = 20, json: bool = False) -> None:
    """Identify so many models, one after the other and in parallel."""
    taken = measure(models)
    speed_up = {name: taken["one"] / value for name, value in taken.items()}
    of = {"models": models, "iterations": ITERATIONS, "cores": os.cpu_count()}
    show({**of, "seconds": taken, "speed_up": speed_up}, json)


if __name__ == "__main__":
    typer.run(main)
