"""Distribution of run-to-run shifts, and predictions for runs that nobody has measured."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.fitting.threads import threads
from identification.models.simulated_runs import run_of
from identification.scatter.shifts import Effect, Scattered, shifted
from identification.scatter.widths import Width
from identification.validation import convert_fields, read_only
from vibrolock.arrays import Float
from vibrolock.results import Result

_LARGEST = 0.3
"""Largest shift that is drawn: from few runs the distribution has long tails."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OutputBand:
    """Outputs that a fresh run may have.

    Parameters
    ----------
    low, high
        float[n_outputs, n], ends of the band, at every sample.
    unbounded
        Number of draws that became unbounded, and are left out.
    """

    low: Float
    high: Float
    unbounded: int


@dataclass(frozen=True, eq=False, kw_only=True)
class RunScatter(Result):
    """Shifts of a model's linear part from run to run (`identification.fit_with_scatter`).

    Parameters
    ----------
    effects
        What shifts.
    widths
        Width of the distribution of each effect, with its 95 % interval.
    runs
        Names of the runs.
    shifts
        float[n_runs, n_effects], each run's shifts from the middle: the estimates, drawn towards it by what their variances
        say.
    estimates, variances
        float[n_runs, n_effects], what the run's own data say.
    misfit
        float[n_outputs], RMS of what is left in the training runs with their shifts, in units of the outputs.
    fits
        Number of fits.
    settled
        Whether the shifts did not change any more.
    """

    effects: tuple[Effect, ...]
    widths: tuple[Width, ...]
    runs: tuple[str, ...]
    shifts: Float
    estimates: Float
    variances: Float
    misfit: Float
    fits: int
    settled: bool

    def __post_init__(self) -> None:
        convert_fields(self, read_only, "shifts", "estimates", "variances", "misfit")

    def model_of(self, model: Scattered, run: str) -> Scattered:
        """Return the model of one of the runs. Raises `IdentificationError` if there is none of this name."""
        IdentificationError.unless_one_of("run", run, self.runs)
        return shifted(model, self.effects, self.shifts[self.runs.index(run)])

    def fresh(self, model: Scattered, count: int, seed: int = 0) -> Iterator[Scattered]:
        """Yield models of ``count`` runs that nobody has measured.

        Shifts of n runs of which mean and width were estimated: a further one follows Student's t with n - 1 degrees of
        freedom, times the width and ``sqrt(1 + 1/n)``; at most 0.3. What the noise leaves open in the shared parameters is not
        drawn.
        """
        generator = np.random.default_rng(seed)
        n = len(self.runs)
        size = np.array([width.width for width in self.widths]) * np.sqrt(1.0 + 1.0 / n)
        for _ in range(count):
            drawn = size * generator.standard_t(n - 1, len(size))
            yield shifted(model, self.effects, np.clip(drawn, -_LARGEST, _LARGEST))

    def band(
        self, model: Scattered, experiment: Experiment, *, share: float = 0.95, draws: int = 200, seed: int = 0
    ) -> OutputBand:
        """Return the band of the outputs of a fresh run under the inputs of an experiment.

        Quantiles of ``draws`` fresh runs at every sample, widened by the misfit of the training runs as an independent error.
        A periodic run begins on the branch that the experiment's outputs show (`StructuredModel.simulate_experiment`); they do
        not count otherwise.
        """
        from scipy.special import ndtri  # only on use: it takes long to load

        IdentificationError.raise_if(not 0.0 < share < 1.0, field="share", value=share, allowed="between 0 and 1")
        ends = (0.5 - 0.5 * share, 0.5 + 0.5 * share)
        with threads() as count, ThreadPoolExecutor(count) as pool:
            runs = list(pool.map(lambda one: run_of(one, experiment), self.fresh(model, draws, seed)))
        bounded = [run.outputs for run in runs if run.unbounded_at is None]
        if not bounded:
            raise IdentificationError(f"experiment '{experiment.name}': no fresh run stays bounded")
        middle = run_of(model, experiment).outputs
        low, high = np.quantile(bounded, ends, axis=0)
        added = float(ndtri(ends[1])) * self.misfit[:, None]
        return OutputBand(
            low=middle - np.hypot(np.maximum(middle - low, 0.0), added),
            high=middle + np.hypot(np.maximum(high - middle, 0.0), added),
            unbounded=len(runs) - len(bounded),
        )
