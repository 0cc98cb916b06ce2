"""Do the intervals of structured models hold the truth? ``python -m benchmarks.structured_intervals [--unsettled]``.

The structure of `tests/identification/models/structured/test_elements.py`: three modes, two known to a modal test, a joint
and a cubic spring where no sensor is, integrated by another method with steps of 4 us. For each seed of noise three multisines
are fitted, two periods of each, and 95 % intervals of what has a unit of its own are held against the truth. With
``--unsettled`` they begin 1 s after a start from rest: 0.2 % of what is called periodic is a transient.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import typer
from joblib import Parallel, delayed

from identification import Experiment, StructuredModel, fit_structured
from identification.models import Jenkins, PolynomialSpring, std_of
from tests.identification.models.structured import test_elements as truth
from vibrolock.arrays import Float

QUANTITIES = (
    "stiffness of the joint",
    "slip of the joint",
    "cubic coefficient",
    "frequency 1",
    "frequency 2",
    "damping ratio 1",
    "damping ratio 2",
    "direction of the joint, mode 2 to 1",
    "direction of the joint, mode 3 to 1",
    "direction of the spring, mode 1 to 2",
    "direction of the spring, mode 3 to 2",
)
RUNS = ((2.0, 1), (6.0, 2), (6.0, 3))
"""RMS (N) and seed of the phases of each multisine."""
STEPS = 256
"""Of the truth in a sample. With the 64 of the tests the leapfrog rule raises frequency 2 by 1.2e-6 of itself, which is more
than its standard error."""
STARTED = 1000
"""Samples from rest to the first period of unsettled data."""


def of_truth(model: StructuredModel) -> Float:
    """Quantities of a model over those of the truth; scale and direction of an element are one freedom."""
    joint, spring = model.elements
    (jenkins,), (cubic,) = joint.laws, spring.laws
    assert isinstance(jenkins, Jenkins)
    assert isinstance(cubic, PolynomialSpring)
    at_joint, at_spring = joint.direction[0] / truth.JOINT[0], spring.direction[1] / truth.SPRING[1]
    frequencies, damping = model.frequency_hz[:2] / (truth.OMEGA[:2] / (2.0 * np.pi)), model.damping_ratio[:2]
    return np.array(
        [
            jenkins.stiffness_n / joint.scale_m * at_joint**2 / truth.STIFFNESS_N_M,
            jenkins.slip * joint.scale_m / at_joint / truth.SLIP_M,
            cubic.coefficients_n[1] / spring.scale_m**3 * at_spring**4 / truth.CUBIC_N_M3,
            *frequencies,
            *(damping / truth.ZETA[:2]),
            *(joint.direction[1:] / joint.direction[0] / (truth.JOINT[1:] / truth.JOINT[0])),
            *(spring.direction[[0, 2]] / spring.direction[1] / (truth.SPRING[[0, 2]] / truth.SPRING[1])),
        ]
    )


@cache
def two_periods(rms_n: float, phases: int, unsettled: bool) -> Experiment:
    """Two periods that count, without noise, and one ahead."""
    settled, size = truth.experiment(rms_n, phases), truth.PERIOD
    outputs = truth.periods(rms_n, phases, STEPS).reshape(len(settled.outputs), -1)
    start = STARTED if unsettled else outputs.shape[1] - 2 * size
    outputs = outputs[:, start : start + 2 * size]
    inputs = np.roll(settled.inputs[:, :size], -start, axis=1)
    return replace(settled, inputs=np.tile(inputs, 3), outputs=np.hstack([outputs[:, :size], outputs]))


def of_seed(seed: int, unsettled: bool) -> tuple[Float, Float]:
    """Quantities of the fit to one seed of noise, and their standard errors."""
    runs = [
        truth.noisy(two_periods(rms, phases, unsettled), 1000 * seed + phases).averaged(transient_samples=truth.PERIOD)
        for rms, phases in RUNS
    ]
    fit = fit_structured(truth.modes(), runs, elements=truth.JOINT_FIRST, support=False, steps=8)
    return of_truth(fit.model), std_of(fit, of_truth)


def main(seeds: int = 50, jobs: int = 2, unsettled: bool = False) -> None:
    """Print bias, scatter, stated standard error and coverage of each quantity, in per cent."""
    found = Parallel(jobs)(delayed(of_seed)(seed, unsettled) for seed in range(seeds))
    values, std = (np.array(part) for part in zip(*found, strict=True))
    print("quantity, bias %, scatter %, stated %, intervals that hold the truth")
    for name, value, stated in zip(QUANTITIES, values.T, std.T, strict=True):
        held = int(np.sum(np.abs(value - 1.0) <= 1.96 * stated))
        bias, scatter = 100.0 * (np.mean(value) - 1.0), 100.0 * np.std(value, ddof=1)
        print(
            f"{name}, {bias:+.4f}, {scatter:.4f}, {100.0 * np.median(stated):.4f}, {held} of {seeds}",
            flush=True,
        )


if __name__ == "__main__":
    typer.run(main)
