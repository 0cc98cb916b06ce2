"""Public benchmark data as experiments, from the folder that VIBROLOCK_DATA names. Nothing of it is part of this project.

Silverbox: Wigren and Schoukens, European Control Conference 2013, `SNLS80mV.mat`. Bouc-Wen: Noel and Schoukens, Workshop on
Nonlinear System Identification Benchmarks, 2016, as `boucwen_train_dynonet.h5` and `boucwen_test_dynonet.h5` of
https://github.com/forgi86/dynonet.
"""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from scipy.io import loadmat

from identification import Channel, Experiment

SILVERBOX = "SNLS80mV.mat"
BOUC_WEN = ("boucwen_train_dynonet.h5", "boucwen_test_dynonet.h5")

_ARROW = 40_000
_FIRST_PERIOD, _PERIOD, _BLOCK, _AHEAD = 40_984, 8192, 8692, 500
"""The multisines: a block is 100 samples at zero, 400 of the end of the period, the period."""


@dataclass(frozen=True)
class Benchmark:
    estimation: list[Experiment]
    validation: list[Experiment]
    test: list[Experiment]


def path_of(name: str) -> Path | None:
    """Where a file is; None without it."""
    path = Path(os.environ.get("VIBROLOCK_DATA", "")) / name
    return path if "VIBROLOCK_DATA" in os.environ and path.is_file() else None


def silverbox(path: Path) -> Benchmark:
    """Nine multisines, one for validation, the arrow; volts, offsets as measured and made up for by a constant input."""
    data = loadmat(path)
    u, y = data["V1"].reshape(1, -1), data["V2"].reshape(1, -1)
    offset = float(np.mean(y[0, _FIRST_PERIOD:]))

    def part(begin: int, end: int, counted_from: int, name: str) -> Experiment:
        return Experiment(
            inputs=u[:, begin:end],
            outputs=y[:, begin:end] - offset,
            sample_rate_hz=1e7 / 2**14,
            input_channels=(Channel("input", "monitor", "V"),),
            output_channels=(Channel("output", "monitor", "V"),),
            counted_from=counted_from,
            period_samples=_PERIOD if counted_from else 0,
            # The record begins while the output still swings.
            initial_state="zero" if counted_from else "estimated",
            name=name,
        ).with_constant_input(0.02)

    begins = _FIRST_PERIOD + _BLOCK * np.arange(10)
    sines = [part(b - _AHEAD, b + _PERIOD, _AHEAD, f"multisine {k + 1}") for k, b in enumerate(begins)]
    return Benchmark(sines[:9], sines[9:], [part(0, _ARROW, 0, "arrow")])


def bouc_wen(train: Path, test: Path) -> Benchmark:
    """One multisine, the mean of its last four of five periods: its last eighth for validation. Two tests, clean."""

    def read(path: Path, group: str) -> tuple[np.ndarray, np.ndarray]:
        with h5py.File(path) as file:
            return np.array(file[group]["u"]).reshape(1, -1), np.array(file[group]["y"]).reshape(1, -1)

    def experiment(u: np.ndarray, y: np.ndarray, counted_from: int, period: int, name: str) -> Experiment:
        return Experiment(
            inputs=u,
            outputs=y,
            sample_rate_hz=750.0,
            input_channels=(Channel("force", "force", "N"),),
            output_channels=(Channel("displacement", "drive", "m"),),
            counted_from=counted_from,
            period_samples=period,
            name=name,
        )

    ahead = 1000
    whole = experiment(*read(train, "multisine"), 8192, 8192, "multisine").averaged(transient_samples=ahead)
    cut = ahead + 7 * 1024
    estimation = experiment(whole.inputs[:, :cut], whole.outputs[:, :cut], ahead, 0, "seven eighths of the multisine")
    validation = replace(whole, counted_from=cut, period_samples=0, name="last eighth")
    u, y = read(test, "multisine")
    settled = experiment(
        np.tile(u, 2)[:, 8192 - ahead :], np.tile(y, 2)[:, 8192 - ahead :], ahead, 8192, "test multisine"
    )
    sweep = experiment(*read(test, "sinesweep"), 0, 0, "sine sweep")
    return Benchmark([whole, estimation], [validation], [settled, sweep])
