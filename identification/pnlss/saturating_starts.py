"""Where models with saturating features begin, whose weights no linear model tells: random directions, several tries.

The fit is not convex in the weights. Of four starts, most end within 2 dB of each other and one in ten far off; which ones is
clear after some twenty iterations, so that a few starts compared there cost less than any careful choice of one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.experiment import Experiment
from identification.pnlss.features import Features
from identification.pnlss.fitting.fit import fit_pnlss
from identification.pnlss.fitting.result import PnlssFit
from identification.pnlss.fitting.settings import FitSettings
from identification.pnlss.model import PnlssModel

__all__ = ["best_of_starts", "random_start"]

Float = NDArray[np.float64]

STARTS = 4
TRIAL_ITERATIONS = 20
_COEFFICIENT = 0.03
"""Of what is fed back, relative to the RMS of the state or output: near the linear model, but weights count from the first."""


def random_start(
    linear: PnlssModel,
    experiments: Sequence[Experiment],
    phi: Features,
    chi: Features,
    counts: tuple[int, int],
    random: np.random.Generator,
) -> PnlssModel:
    """The linear model with the monomials of ``phi`` and ``chi`` and so many saturating features in each equation.

    Weights and biases are normal, of deviation one for variables of RMS one. Coefficients of monomials are zero.
    """
    states = np.hstack([linear.simulate(e.inputs).states[:, e.counted_from :] for e in experiments])
    inputs, outputs = (np.hstack([getattr(e, name) for e in experiments]) for name in ("inputs", "counted_outputs"))
    size_x, size_u, size_y = (np.sqrt(np.mean(values**2, axis=1)) for values in (states, inputs, outputs))
    size = np.concatenate([size_x, size_u, [1.0]])
    weights = [random.normal(size=(count, size.size)) / size for count in counts]
    start = linear.with_features(replace(phi, weights=weights[0]), replace(chi, weights=weights[1]))
    e, f = np.array(start.e), np.array(start.f)
    e[:, phi.count :] = _COEFFICIENT * size_x[:, None] * random.normal(size=(len(e), counts[0]))
    f[:, chi.count :] = _COEFFICIENT * size_y[:, None] * random.normal(size=(len(f), counts[1]))
    return replace(start, e=e, f=f)


def best_of_starts(
    starts: Sequence[PnlssModel],
    experiments: Sequence[Experiment],
    *,
    validation: Sequence[Experiment],
    settings: FitSettings,
) -> tuple[PnlssModel, PnlssFit]:
    """The start whose error is smallest after some iterations, and its fit so far."""
    trial = replace(settings, iterations=min(settings.iterations, TRIAL_ITERATIONS), patience=0)
    best: tuple[PnlssModel, PnlssFit] | None = None
    for start in starts:
        found = fit_pnlss(start, experiments, validation=validation, settings=trial)
        if best is None or _error(found) < _error(best[1]):
            best = (start, found)
        if found.interrupted:
            return best[0], replace(best[1], interrupted=True, stopped=found.stopped)
    assert best is not None
    return best


def _error(found: PnlssFit) -> float:
    return found.training_error if np.isnan(found.validation_error) else found.validation_error
