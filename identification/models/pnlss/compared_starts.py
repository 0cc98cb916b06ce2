"""Fits from several starts: every few iterations only the better half continues.

Good starts show early (successive halving: Jamieson and Talwalkar, AISTATS 2016).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from identification.experiments.experiment import Experiment
from identification.fitting.result import Ending, FitProgress, FitStatus
from identification.models.pnlss.fitting.fit import fit_pnlss
from identification.models.pnlss.fitting.result import FitSettings, PnlssFit
from identification.models.pnlss.model import PnlssModel

STARTS = 4  # random starts that are compared; chosen
_ROUNDS = (10, 30)
"""Numbers of iterations, counted from the beginning, after which only the better half of the starts continues."""


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
            stage = f"start {number + 1} of {len(starts)}"
            try:
                fits[number] = fit_pnlss(
                    starts[number],
                    experiments,
                    validation=validation,
                    settings=limits,
                    progress=None if progress is None else partial(_staged, progress, stage),
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
    return replace(fit, **Ending.of(FitStatus.INTERRUPTED)._asdict())


def _staged(progress: Callable[[FitProgress], None], stage: str, at: FitProgress) -> None:
    progress(replace(at, stage=stage))


def _error(found: PnlssFit) -> float:
    return found.training_error if np.isnan(found.validation_error) else found.validation_error
