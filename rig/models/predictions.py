"""Files of predictions."""

from typing import Any

import numpy as np

from identification import Predictions, SteadyPrediction, SweepPrediction
from rig.console import number, print_table
from rig.figures.predictions import draw_predictions
from rig.models.kind import Kind

__all__ = ["PREDICTIONS"]


def _steady(response: SteadyPrediction) -> dict[str, Any]:
    peak = response.peak()
    return {
        "name": response.name,
        "force_n": response.force_n,
        "force": response.force,
        "peak_m": peak.amplitude_m,
        "peak_frequency_hz": peak.frequency_hz,
        "peak_phase_lag_deg": peak.phase_lag_deg,
        "folds_hz": response.fold_frequency_hz.tolist(),
        "detached_branches": int(response.branch.max()),
        "range_use": float(response.range_use[response.branch == 0].max()),
        "notes": list(response.notes),
    }


def _sweep(sweep: SweepPrediction, name: str) -> dict[str, Any]:
    peak_m, peak_hz = sweep.peak()
    return {
        "name": name,
        "origin": sweep.origin,
        "peak_m": peak_m,
        "peak_frequency_hz": peak_hz,
        "smallest_force_n": float(np.abs(sweep.force).min()),
        "range_use": sweep.range_use,
        "notes": list(sweep.notes),
    }


def _summarise(predictions: Predictions) -> dict[str, Any]:
    names = [error.name if error else f"sweep {i}" for i, error in enumerate(predictions.sweep_errors)]
    return {
        "specimen": predictions.specimen,
        "frequency_responses": [_steady(response) for response in predictions.steady],
        "sweeps": [_sweep(sweep, name) for sweep, name in zip(predictions.sweeps, names, strict=True)],
        "errors": [error.row() for error in predictions.errors],
        "notes": list(predictions.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    if summary["frequency_responses"]:
        print("frequency responses at constant force")
        print_table(
            ("force", "peak mm", "at Hz", "lag deg", "folds at Hz", "range use"),
            [
                (
                    r["name"],
                    number(r["peak_m"], ".5f", 1e3),
                    number(r["peak_frequency_hz"], ".4f"),
                    number(r["peak_phase_lag_deg"], ".1f"),
                    ", ".join(f"{fold:.4f}" for fold in r["folds_hz"]) or "none",
                    number(r["range_use"], ".2f"),
                )
                for r in summary["frequency_responses"]
            ],
        )
    if summary["sweeps"]:
        print("sweeps")
        print_table(
            ("sweep", "from", "peak mm", "at Hz", "least force N", "range use"),
            [
                (
                    s["name"],
                    s["origin"],
                    number(s["peak_m"], ".5f", 1e3),
                    number(s["peak_frequency_hz"], ".3f"),
                    number(s["smallest_force_n"], ".4f"),
                    number(s["range_use"], ".2f"),
                )
                for s in summary["sweeps"]
            ],
        )
    if summary["errors"]:
        print("errors: predicted over reference, minus one")
        print_table(
            ("prediction", "peak %", "frequency %", "envelope %", "range use", ""),
            [
                (
                    e["name"],
                    number(e["peak_error"], "+.2f", 100.0),
                    number(e["peak_frequency_error"], "+.3f", 100.0),
                    number(e["envelope_error"], ".2f", 100.0),
                    number(e["range_use"], ".2f"),
                    e["verdict"],
                )
                for e in summary["errors"]
            ],
        )
    for part in (*summary["frequency_responses"], *summary["sweeps"]):
        for note in part["notes"]:
            print(f"note: {part['name']}: {note}")


PREDICTIONS = Kind(
    name="predictions",
    holds=Predictions,
    pack=Predictions.to_arrays,
    unpack=Predictions.from_arrays,
    summarise=_summarise,
    say=_say,
    draw=draw_predictions,
    figure_in=(12.0, 7.0),
)
