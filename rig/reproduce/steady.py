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
    identify_exciter,
    pnlss_frequency_response,
)
from rig.analysis.subject import subject_of
from rig.measurements import spectra
from rig.recording.reader import Recording
from rig.reproduce.options import Options
from rig.reproduce.recordings import recorded
from simulators.analysis import PeriodicResponses, constant_force_response, phase_resonance_backbone

__all__ = ["Steady", "steady"]

_NEAR_RESONANCE = np.linspace(-170.0, -10.0, 81)


@dataclass(frozen=True, eq=False)
class Steady:
    """One predicted response with the truth that it is held against."""

    training_set: str
    """Of the model."""
    model: str
    """Its name."""
    force_n: float
    """Peak of the fundamental, or of the sine."""
    held: str
    """``pure-sine``, or ``fundamental`` with the harmonics that the exciter makes."""
    prediction: SteadyPrediction | None
    """None where there is none."""
    reason: str
    """Why not."""
    truth_m: float
    """Largest amplitude of the rig's drive point."""
    truth_hz: float
    """Where."""

    @property
    def complete(self) -> bool:
        """Whether the response is one from the lowest frequency to the highest: else its largest amplitude is no peak."""
        return self.prediction is not None and not np.any(self.prediction.branch)

    def row(self) -> dict[str, Any]:
        """Numbers for tables and JSON."""
        head = {
            "training_set": self.training_set,
            "model": self.model,
            "force_n": self.force_n,
            "force": self.held,
            "truth_m": self.truth_m,
            "truth_hz": self.truth_hz,
        }
        if self.prediction is None:
            return {
                **head,
                "peak_m": None,
                "peak_hz": None,
                "error": None,
                "range_use": None,
                "complete": False,
                "notes": [self.reason],
            }
        peak = self.prediction.peak()
        return {
            **head,
            "peak_m": peak.amplitude_m,
            "peak_hz": peak.frequency_hz,
            "error": peak.amplitude_m / self.truth_m - 1.0,
            "frequency_error": peak.frequency_hz / self.truth_hz - 1.0,
            "range_use": float(np.max(self.prediction.range_use)),
            "complete": self.complete,
            "notes": list(self.prediction.notes),
        }


def steady(
    options: Options, models: Mapping[str, tuple[str, PnlssModel]], say: Callable[[str], None]
) -> tuple[list[Steady], dict[float, PeriodicResponses]]:
    """Predictions of the selected models (by training set), and the rig's response to each force of an exciter.

    A force-input model answers a pure sine, as in the paper, and with the identified exciter coupled a constant fundamental; a
    voltage-input model has its exciter inside.
    """
    truth = _truth(options)
    exciter = _exciter(options, say) if options.input == "force" else None
    found = []
    for training_set, (name, model) in models.items():
        for force_n in options.specimen.forces_n:
            for held, peak in truth[force_n][1].items():
                if options.input == "voltage" and held == "pure-sine":
                    continue
                prediction, reason = _predicted(options, model, force_n, held, exciter)
                found.append(Steady(training_set, name, force_n, held, prediction, reason, *peak))
    return found, {force_n: curve for force_n, (curve, _) in truth.items()}


def _predicted(
    options: Options, model: PnlssModel, force_n: float, held: str, exciter: Exciter | None
) -> tuple[SteadyPrediction | None, str]:
    low, high = options.specimen.band_hz
    try:
        return (
            pnlss_frequency_response(
                model,
                force_n,
                force="pure-sine" if held == "pure-sine" else "fundamental",
                exciter=exciter if held == "fundamental" else None,
                lowest_hz=low,
                highest_hz=high,
            ),
            "",
        )
    except IdentificationError as error:
        return None, str(error)


def _truth(options: Options) -> dict[float, tuple[PeriodicResponses, dict[str, tuple[float, float]]]]:
    """By force: the response at constant fundamental, and (amplitude, frequency) of the peaks by what is held."""
    rig = subject_of(options.bench).rig
    found = {}
    for force_n in options.specimen.forces_n:
        curve = constant_force_response(rig, force_n, _NEAR_RESONANCE)
        sine = phase_resonance_backbone(
            rig, forces_n=np.linspace(0.1, 1.0, 10) * force_n, excitation="pure-sine"
        )  # lightly damped: the largest amplitude is that at phase resonance
        top = int(np.argmax(curve.amplitude_m))
        found[force_n] = (
            curve,
            {
                "pure-sine": (float(sine.amplitude_m[-1]), float(sine.frequency_hz[-1])),
                "fundamental": (float(curve.amplitude_m[top]), float(curve.frequency_hz[top])),
            },
        )
    return found


def _exciter(options: Options, say: Callable[[str], None]) -> Exciter:
    """The exciter, from its own multisine."""
    with Recording(recorded(options, options.specimen.exciter, say)) as recording:
        measured = next(iter(spectra(recording).values()))
        rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    return identify_exciter(measured, sample_rate_hz=rate_hz)
