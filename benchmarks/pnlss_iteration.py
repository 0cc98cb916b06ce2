"""Seconds per iteration of a nonlinear state-space fit: ``python -m benchmarks.pnlss_iteration [--json]``.

Each case runs some iterations of `fit_pnlss` and takes their median; all that belongs to an iteration is in it: sensitivities,
normal equations, their decomposition, and the simulations that try dampings. The baseline in the same run is what one writes
first in numpy: the recursion sample by sample, the whole Jacobian, its product; on a short piece, scaled to the samples of
the case. One core: the pools of the linear algebra are held to one thread; on a busy machine the processor time and the best
iteration tell more. A fit is there when it is nearer to the data than the system that made them, noise added; NaN for one that
is not. Memory is the peak of the process after each case, the data themselves included.
"""

import json
import os
import resource
import statistics
import sys
import time

for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(pool, "1")

import numpy as np  # noqa: E402 (threads are set first)

from identification import (  # noqa: E402
    Channel,
    Experiment,
    Features,
    FitSettings,
    PnlssModel,
    StateSpace,
    fit_pnlss,
)

ITERATIONS = 7
PIECE = 400
"""Samples of the baseline."""
CASES = {
    "4 states, 4 outputs, 400 coefficients, 25 600": (4, 4, 25_600, True, None),
    "the same, Hessian from all samples": (4, 4, 25_600, True, 1),
    "the same, from one of each 8": (4, 4, 25_600, True, 8),
    "as the first, 256 000": (4, 4, 256_000, True, None),
    "2 states, 1 output, 14 coefficients, 73 728": (2, 1, 73_728, False, None),
    "the same, Hessian from all samples ": (2, 1, 73_728, False, 1),
}


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


def plain(model: PnlssModel, experiment: Experiment) -> float:
    """Seconds per sample of the Jacobian and its product in plain numpy."""
    n, outputs = model.states, len(model.outputs)
    wide, own = n + 1 + model.state_features.count, n + 1 + model.output_features.count
    begin = time.perf_counter()
    states = model.simulate(experiment.inputs[:, :PIECE]).states
    v = np.vstack([states, experiment.inputs[:, :PIECE]])
    z, q = np.vstack([v, model.state_features.values(v)]), np.vstack([v, model.output_features.values(v)])
    by_state = model.a[:, :, None] + np.einsum("if,fjk->ijk", model.e, model.state_features.derivatives(v)[:, :n])
    by_output = model.c[:, :, None] + np.einsum("if,fjk->ijk", model.f, model.output_features.derivatives(v)[:, :n])
    s = np.zeros((n, n * wide))
    jacobian = np.zeros((PIECE, outputs, n * wide + outputs * own))
    for k in range(PIECE):
        jacobian[k, :, : n * wide] = by_output[:, :, k] @ s
        jacobian[k, :, n * wide :] = np.kron(np.eye(outputs), q[:, k])
        s = by_state[:, :, k] @ s + np.kron(np.eye(n), z[:, k])
    rows = jacobian.reshape(-1, jacobian.shape[2])
    rows.T @ rows
    return (time.perf_counter() - begin) / PIECE


def error_of(true: PnlssModel, experiment: Experiment) -> float:
    """Training error of the system itself, as `fit_pnlss` has it."""
    wrong, whole = (
        np.mean(y**2, axis=1)
        for y in (true.simulate(experiment.inputs).outputs - experiment.outputs, experiment.outputs)
    )
    return float(np.sqrt(np.mean(wrong / whole)))


def measure(states: int, outputs: int, samples: int, nonlinear_outputs: bool, every: int | None) -> dict[str, float]:
    """One case."""
    start, true = system(states, outputs, nonlinear_outputs)
    experiment = measured(true, samples)
    fit_pnlss(start, [measured(true, 3000)], settings=FitSettings(iterations=1))  # compiles
    baseline = min(plain(true, experiment) for _ in range(3)) * samples
    processor = [time.process_time()]
    fit = fit_pnlss(
        start,
        [experiment],
        settings=FitSettings(iterations=ITERATIONS, tolerance=0.0, every=every),
        progress=lambda _: processor.append(time.process_time()),
    )
    seconds = np.diff(fit.history.seconds)
    there = np.flatnonzero(fit.history.training_error <= error_of(true, experiment))
    return {
        "coefficients": true.nonlinear_coefficients,
        "seconds": statistics.median(seconds),
        "processor_seconds": statistics.median(np.diff(processor)[1:]),
        "best": float(np.min(seconds)),
        "seconds_until_there": float(fit.history.seconds[there[0]]) if there.size else float("nan"),
        "plain_numpy": baseline,
        "times_faster": baseline / statistics.median(seconds),
        "training_error": fit.training_error,
        "data_mb": (experiment.inputs.nbytes + experiment.outputs.nbytes) / 1e6,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def main() -> None:
    results = {name: measure(*case) for name, case in CASES.items()}
    if "--json" in sys.argv:
        print(json.dumps(results, indent=1))
        return
    columns = (
        "seconds",
        "processor_seconds",
        "best",
        "seconds_until_there",
        "plain_numpy",
        "times_faster",
        "training_error",
        "data_mb",
        "peak_mb",
    )
    print(f"{'':46}" + "".join(f"{name:>20}" for name in columns))
    for name, row in results.items():
        print(f"{name:46}" + "".join(f"{row[column]:20.4g}" for column in columns))


if __name__ == "__main__":
    main()
