"""Steady peaks that the selected models predict, beside those of the virtual rig itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification import (
    Exciter,
    IdentificationError,
    PnlssModel,
    SteadyPrediction,
    pnlss_frequency_response,
)
from rig.reproduce.exciter import exciter_of
from rig.reproduce.options import Options
from rig.reproduce.true_responses import Truth, truths

__all__ = ["Steady", "steady"]


@dataclass(frozen=True, eq=False)
class Steady:
    """One predicted response with the truth that it is held against."""

    training_set: str
    """Of the model."""
    model: str
    """Its name."""
    truth: Truth
    """What the rig does."""
    prediction: SteadyPrediction | None
    """None where there is none."""
    reason: str
    """Why not."""

    @property
    def complete(self) -> bool:
        """Whether the response goes from one end of the band to the other: else its largest amplitude may be no peak."""
        return self.prediction is not None and self.prediction.complete

    def row(self) -> dict[str, Any]:
        """Numbers for tables and JSON."""
        head = {
            "training_set": self.training_set,
            "model": self.model,
            "force_n": self.truth.force_n,
            "held": self.truth.held,
            "level": self.truth.level,
            "truth_m": self.truth.amplitude_m,
            "truth_hz": self.truth.frequency_hz,
        }
        if self.prediction is None:
            return {
                **head,
                "peak_m": None,
                "peak_hz": None,
                "error": None,
                "frequency_error": None,
                "range_use": None,
                "complete": False,
                "notes": [self.reason],
            }
        peak, reached = self.prediction.peak(), self.prediction.peak_reached()
        return {
            **head,
            "peak_m": peak.amplitude_m,
            "peak_hz": peak.frequency_hz,
            "error": peak.amplitude_m / self.truth.amplitude_m - 1.0 if reached else None,
            "frequency_error": peak.frequency_hz / self.truth.frequency_hz - 1.0 if reached else None,
            "range_use": float(np.max(self.prediction.range_use)),
            "complete": self.complete,
            "notes": list(self.prediction.notes),
        }


def steady(
    options: Options, models: Mapping[str, tuple[str, PnlssModel]], say: Callable[[str], None]
) -> tuple[list[Steady], tuple[Truth, ...]]:
    """Predictions of the selected models (by training set), and what the rig does.

    A force-input model answers a pure sine, as in the paper, and with the identified exciter coupled a constant fundamental. A
    voltage-input model has its exciter inside: it answers a constant voltage, and a constant fundamental of the force that
    it has among its outputs.
    """
    known = truths(options)
    exciter = exciter_of(options, say) if options.input == "force" else None
    found = []
    for training_set, (name, model) in models.items():
        for truth in known:
            prediction, reason = _predicted(options, model, truth, exciter)
            found.append(Steady(training_set, name, truth, prediction, reason))
    return found, known


def _predicted(
    options: Options, model: PnlssModel, truth: Truth, exciter: Exciter | None
) -> tuple[SteadyPrediction | None, str]:
    low, high = options.specimen.band_hz
    try:
        found = pnlss_frequency_response(
            model,
            truth.level,
            force=truth.held,
            exciter=exciter if truth.held == "fundamental" else None,
            lowest_hz=low,
            highest_hz=high,
        )
    except IdentificationError as error:
        return None, str(error)
    return found, ""
