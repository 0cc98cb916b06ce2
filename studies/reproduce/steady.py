"""Steady peaks predicted by the selected models, compared with those of the virtual rig itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification import IdentificationError, SteadyPrediction, frequency_response
from rig.results.simulated.driven_models import LARGEST_RANGE_USE, DrivenModel, level_of
from studies.reproduce.options import Options
from studies.reproduce.recordings import exciter_of
from studies.reproduce.true_responses import Truth, truths


@dataclass(frozen=True, eq=False)
class Steady:
    """One predicted response with the true response of the rig."""

    training_set: str
    """Training set of the model."""
    model: str
    """Name of the model."""
    truth: Truth
    """True response of the rig."""
    prediction: SteadyPrediction | None
    """Predicted response; None if there is none."""
    reason: str
    """Why there is no prediction."""

    @property
    def complete(self) -> bool:
        """Whether the response covers the whole band. Otherwise its largest amplitude may not be a peak."""
        return self.prediction is not None and self.prediction.complete

    def row(self) -> dict[str, Any]:
        """Return the numbers for tables and JSON."""
        row: dict[str, Any] = {
            "training_set": self.training_set,
            "model": self.model,
            "force_n": self.truth.force_n,
            "held": self.truth.held,
            "level": self.truth.level,
            "truth_m": self.truth.amplitude_m,
            "truth_hz": self.truth.frequency_hz,
        }
        row |= dict.fromkeys(("peak_m", "peak_hz", "error", "frequency_error", "range_use"))
        row |= {"complete": self.complete, "notes": [self.reason]}
        if self.prediction is None:
            return row
        peak = self.prediction.peak()
        row |= {"peak_m": peak.amplitude_m, "peak_hz": peak.frequency_hz, "notes": list(self.prediction.notes)}
        row["range_use"] = float(np.max(self.prediction.range_use))
        if self.prediction.peak_reached():
            row["error"] = peak.amplitude_m / self.truth.amplitude_m - 1.0
            row["frequency_error"] = peak.frequency_hz / self.truth.frequency_hz - 1.0
        return row


def steady(
    options: Options, models: Mapping[str, tuple[str, DrivenModel]], say: Callable[[str], None]
) -> tuple[list[Steady], tuple[Truth, ...]]:
    """Return the predictions of the selected models (by training set), and the true responses of the rig.

    A force-input model predicts the response to a pure sine, as in the paper, and with the identified exciter that at constant
    fundamental. A voltage-input model contains its exciter: it predicts the response at constant voltage, and at a constant
    fundamental of the force, which is among its outputs.
    """
    known = truths(options)
    exciter = exciter_of(options, say) if options.input == "force" else None
    found = []
    for training_set, (name, model) in models.items():
        for truth in known:
            used = exciter if truth.held == "fundamental" else None
            prediction, reason = None, ""
            try:
                prediction = frequency_response(
                    model,
                    exciter=used,
                    band_hz=options.specimen.band_hz,
                    largest_range_use=LARGEST_RANGE_USE,
                    **level_of(truth.level, truth.held),
                )
            except IdentificationError as error:
                reason = str(error)
            found.append(Steady(training_set, name, truth, prediction, reason))
    return found, known
