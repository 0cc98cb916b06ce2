"""Errors of models that are simulated with the inputs of experiments."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.experiments.checks import belongs, check_not_zero
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.experiments.simulators import Simulator, simulated
from identification.validation import convert_fields, read_only
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssErrors:
    """Errors of one model on experiments.

    Parameters
    ----------
    relative
        float[n_experiments, n_outputs], RMS of the output error over the RMS of the measured output, over the samples that
        count (Scheel et al., the relative error of Section 3.3); inf for an unbounded run.
    rms
        float[n_experiments, n_outputs], RMS of the output error in the units of the outputs.
    bounded
        bool[n_experiments], whether the run stayed bounded.
    range_use
        float[n_experiments], largest state or input over the largest in the training data; inf for an unbounded run, NaN
        where unknown.
    names
        One per experiment.
    levels
        float[n_experiments].
    """

    relative: Float
    rms: Float
    bounded: NDArray[np.bool_]
    range_use: Float
    names: tuple[str, ...]
    levels: Float

    def __post_init__(self) -> None:
        convert_fields(self, read_only, "relative", "rms", "range_use", "levels")
        object.__setattr__(self, "bounded", read_only(self.bounded, np.bool_))

    @property
    def overall(self) -> Float:
        """float[n_experiments]: RMS over outputs of the relative errors."""
        return np.asarray(np.sqrt(np.mean(self.relative**2, axis=1)))

    @property
    def unbounded(self) -> int:
        """Number of unbounded runs."""
        return int(np.count_nonzero(~self.bounded))


def errors_of(
    model: Simulator, experiments: Sequence[Experiment], simulate: Callable[[Experiment], Simulation] | None = None
) -> PnlssErrors:
    """Simulate each experiment, by default with `simulated`, and compare.

    Raises `IdentificationError` if there are no experiments, their channels or sample rates differ from the model's, or an
    output is zero where it counts.
    """
    IdentificationError.raise_if(not experiments, "none given", field="experiments", allowed="one at least")
    relative, rms = np.full((2, len(experiments), len(model.outputs)), np.inf)
    bounded, use = np.zeros(len(experiments), dtype=bool), np.full(len(experiments), np.inf)
    for index, experiment in enumerate(experiments):
        what = f"experiments[{index}]{f' ({experiment.name})' if experiment.name else ''}"
        belongs(model, experiment, what)
        check_not_zero(experiment, what)
        scale = np.max(np.abs(experiment.counted_outputs), axis=1)
        run = simulate(experiment) if simulate else simulated(model, experiment)
        bounded[index], use[index] = run.unbounded_at is None, run.range_use
        if bounded[index]:
            with np.errstate(over="ignore"):
                errors = (run.outputs[:, experiment.counted_from :] - experiment.counted_outputs) / scale[:, None]
                rms[index] = scale * np.sqrt(np.mean(errors**2, axis=1))
            relative[index] = rms[index] / (
                scale * np.sqrt(np.mean((experiment.counted_outputs / scale[:, None]) ** 2, axis=1))
            )
    return PnlssErrors(
        relative=relative,
        rms=rms,
        bounded=bounded,
        range_use=use,
        names=tuple(e.name or f"experiment {index + 1}" for index, e in enumerate(experiments)),
        levels=np.array([e.level for e in experiments]),
    )
