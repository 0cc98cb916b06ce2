"""Seconds per iteration of a nonlinear state-space fit: ``python -m benchmarks.pnlss_iteration [--json]``.

Each case runs some iterations of `fit_pnlss` and takes their median; all that belongs to an iteration is in it: sensitivities,
normal equations, their decomposition, and the simulations that try dampings. The baseline in the same run is the product of a
Jacobian of that size with itself by the machine's own ``dsyrk`` on one core: what a fit costs at least that multiplies
derivatives of outputs. Its ratio is that of processor times, which tell more than wall times on a busy machine. A fit is there
when it is nearer to the data than the system that made them, noise added; NaN for one that is not. Memory is the peak of the
process after each case, the data themselves included. Each number of threads has a process of its own.
"""

import os
import resource
import statistics
import subprocess
import sys
import time
from json import loads

import numpy as np
import typer
from scipy.linalg.blas import dsyrk

from benchmarks.frame import show
from identification import Channel, Experiment, Features, FitSettings, PnlssModel, StateSpace, fit_pnlss

CASES = {
    "4 states, 4 outputs, 400 coefficients, 25 600": (4, 4, 25_600, True, 7),
    "the same, 256 000": (4, 4, 256_000, True, 3),
    "2 states, 1 output, 14 coefficients, 73 728": (2, 1, 73_728, False, 7),
}
POOLS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def system(states: int, outputs: int, nonlinear_outputs: bool) -> tuple[PnlssModel, PnlssModel]:
    """A start, and what is measured."""
    rng = np.random.default_rng(0)
    a = np.zeros((states, states))
    for first in range(0, states, 2):
        pole = np.exp((-0.02 + 1j) * (0.25 + 0.15 * first))
        a[first : first + 2, first : first + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    matrices = StateSpace(
        a, 0.2 * rng.normal(size=(states, 1)), rng.normal(size=(outputs, states)), np.zeros((outputs, 1))
    )
    linear = PnlssModel.linear(
        matrices,
        sample_rate_hz=1000.0,
        inputs=(Channel("force", "force", "N"),),
        outputs=tuple(Channel(f"a{index}", "response", "m/s2") for index in range(outputs)),
    )
    of = None if nonlinear_outputs else range(states)
    phi = Features.monomials(states, 1, (2, 3), of=of)
    start = linear.with_features(phi, phi if nonlinear_outputs else None)
    true = PnlssModel(
        **{**vars(start), "e": 0.003 * rng.normal(size=start.e.shape), "f": 0.02 * rng.normal(size=start.f.shape)}
    )
    return start, true


def measured(true: PnlssModel, samples: int) -> Experiment:
    """A run under noise, with noise."""
    rng = np.random.default_rng(1)
    inputs = 0.3 * rng.normal(size=(1, samples))
    run = true.simulate(inputs)
    return Experiment(
        inputs=inputs,
        outputs=run.outputs + 0.01 * np.std(run.outputs) * rng.normal(size=run.outputs.shape),
        sample_rate_hz=true.sample_rate_hz,
        input_channels=true.inputs,
        output_channels=true.outputs,
    )


def syrk(model: PnlssModel, samples: int) -> float:
    """Processor seconds of the product with itself of the derivatives that outputs share, block by block."""
    columns = model.states * (model.states + 1 + model.state_features.count)
    block = np.random.default_rng(0).normal(size=(1024, columns))
    total = np.zeros((columns, columns), order="F")
    begin = time.process_time()
    for _ in range(samples * len(model.outputs) // len(block)):
        dsyrk(1.0, block.T, beta=1.0, c=total, overwrite_c=1)
    return time.process_time() - begin


def error_of(true: PnlssModel, experiment: Experiment) -> float:
    """Training error of the system itself, as `fit_pnlss` has it."""
    wrong = np.mean((true.simulate(experiment.inputs).outputs - experiment.outputs) ** 2, axis=1)
    return float(np.sqrt(np.mean(wrong / np.mean(experiment.outputs**2, axis=1))))


def measure(states: int, outputs: int, samples: int, nonlinear_outputs: bool, iterations: int) -> dict[str, float]:
    """One case."""
    start, true = system(states, outputs, nonlinear_outputs)
    experiment = measured(true, samples)
    fit_pnlss(start, [measured(true, 3000)], settings=FitSettings(iterations=1))  # compiles
    product, processor = [syrk(true, samples) for _ in range(3)], [time.process_time()]
    fit = fit_pnlss(
        start,
        [experiment],
        settings=FitSettings(iterations=iterations, tolerance=0.0),
        progress=lambda _: processor.append(time.process_time()),
    )
    product += [syrk(true, samples) for _ in range(3)]
    seconds = np.diff(fit.history.seconds)
    there = np.flatnonzero(fit.history.training_error <= error_of(true, experiment))
    used = statistics.median(np.diff(processor)[1:])
    return {
        "coefficients": true.nonlinear_coefficients,
        "seconds": statistics.median(seconds),
        "processor_seconds": used,
        "best": float(np.min(seconds)),
        "syrk": statistics.median(product),
        "seconds_until_there": float(fit.history.seconds[there[0]]) if there.size else float("nan"),
        "training_error": fit.training_error,
        "data_mb": (experiment.inputs.nbytes + experiment.outputs.nbytes) / 1e6,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


HERE = """
import json
from benchmarks.pnlss_iteration import CASES, measure
print(json.dumps({name: measure(*case) for name, case in CASES.items()}))
"""


def main(json: bool = False) -> None:
    """Measure all cases with one and with two threads."""
    results = {}
    for threads in (1, 2):
        environment = {**os.environ, **dict.fromkeys(POOLS, str(threads))}
        out = subprocess.run([sys.executable, "-c", HERE], env=environment, capture_output=True, text=True, check=True)
        cases = results[f"threads: {threads}"] = loads(out.stdout)
        for case, row in cases.items():
            product = results["threads: 1"][case]["syrk"]
            row |= {"over_syrk": row["processor_seconds"] / product, "wall_over_syrk": row["seconds"] / product}
    show(results, json)


if __name__ == "__main__":
    typer.run(main)
