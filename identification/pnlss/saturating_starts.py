"""Random starts for models with saturating features, whose weights no linear model determines.

The fit is not convex in the weights. Fits from different starts end some dB apart, one in ten far off, and the bad ones show
early. Several fits are therefore begun, and every few iterations only the better half continues (successive halving: Jamieson
and Talwalkar, AISTATS 2016).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.experiment import Experiment
from identification.pnlss.features import Features
from identification.pnlss.fitting.fit import fit_pnlss
from identification.pnlss.fitting.result import PnlssFit
from identification.pnlss.fitting.settings import FitProgress, FitSettings
from identification.pnlss.model import PnlssModel

__all__ = ["best_of_starts", "interrupted", "random_start"]

Float = NDArray[np.float64]

STARTS = 8
_ROUNDS = (10, 20, 60)
"""Numbers of iterations, counted from the beginning, after which only the better half of the starts continues."""
_COEFFICIENT = 0.03
"""Initial coefficients relative to the RMS of the state or output: near the linear model, but weights matter from the first."""


def random_start(
    linear: PnlssModel,
    experiments: Sequence[Experiment],
    phi: Features,
    chi: Features,
    counts: tuple[int, int],
    random: np.random.Generator,
) -> PnlssModel:
    """Return the linear model with the features ``phi`` and ``chi`` and ``counts`` additional saturating ones in each equation.

    Weights and biases are drawn from a normal distribution with standard deviation one for variables of RMS one. Coefficients
    of the features ``phi`` and ``chi`` are zero.
    """
    states = np.hstack([linear.simulate(e.inputs).states[:, e.counted_from :] for e in experiments])
    inputs, outputs = (np.hstack([getattr(e, name) for e in experiments]) for name in ("inputs", "counted_outputs"))
    size_x, size_u, size_y = (np.sqrt(np.mean(values**2, axis=1)) for values in (states, inputs, outputs))
    size = np.concatenate([size_x, size_u, [1.0]])
    weights = [random.normal(size=(count, size.size)) / size for count in counts]
    start = linear.with_features(
        *(replace(own, weights=np.vstack([own.weights, more])) for own, more in zip((phi, chi), weights, strict=True))
    )
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
    progress: Callable[[FitProgress], None] | None = None,
) -> tuple[PnlssModel, PnlssFit]:
    """Return the start that is left after dropping the worse half several times, and its fit so far.

    After an interrupt, returns the best fit so far, or raises KeyboardInterrupt if there is none.
    """
    fits: dict[int, PnlssFit] = {}
    left = list(range(len(starts)))
    for iterations in _ROUNDS:
        limits = replace(settings, iterations=min(settings.iterations, iterations), patience=0)
        for number in left:
            told = None if progress is None else _told(progress, f"start {number + 1} of {len(starts)}")
            try:
                fits[number] = fit_pnlss(
                    starts[number],
                    experiments,
                    validation=validation,
                    settings=limits,
                    progress=told,
                    resume=fits.get(number),
                )
            except KeyboardInterrupt:
                if not fits:
                    raise
                stopped = True
            else:
                stopped = fits[number].interrupted
            if stopped:
                best = min(fits, key=lambda k: _error(fits[k]))
                return starts[best], interrupted(replace(fits[best], settings=settings))
        left = sorted(left, key=lambda k: _error(fits[k]))[: max(len(left) // 2, 1)]
    return starts[left[0]], fits[left[0]]


def interrupted(fit: PnlssFit) -> PnlssFit:
    """Return the fit, marked as interrupted."""
    return replace(fit, interrupted=True, stopped="interrupted")


def _told(progress: Callable[[FitProgress], None], stage: str) -> Callable[[FitProgress], None]:
    return lambda at: progress(replace(at, stage=stage))


def _error(found: PnlssFit) -> float:
    return found.training_error if np.isnan(found.validation_error) else found.validation_error
