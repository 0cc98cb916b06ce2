"""Files of predictions."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import (
    FrequencyResponse,
    PredictionError,
    Predictions,
    ResponseBand,
    SteadyPrediction,
    SweepPrediction,
    Transient,
)
from rig.results.kind import Table
from rig.text.console import number, print_table

PLANNED = "planned"
"""Use of a multisine that has not been measured."""
CUT = "the response from "
"""Beginning of the note on a response that was cut off. The note on the first path precedes that on the second."""
_ERRORS = ("peak %", "frequency %", "envelope %")


def _steady(
    response: SteadyPrediction,
    band: ResponseBand | None,
    reference: FrequencyResponse | None,
    error: PredictionError | None,
) -> dict[str, Any]:
    peak, reached = response.peak(), response.peak_reached()
    return {
        "name": (reference.label if reference else "") or response.name,
        "force_n": None if response.force == "voltage" else response.force_n,
        "voltage_v": response.force_n if response.force == "voltage" else None,
        "force": response.force,
        "complete": response.complete,
        "largest_m": peak.amplitude_m,
        "peak_m": peak.amplitude_m if reached else None,
        "peak_frequency_hz": peak.frequency_hz if reached else None,
        "peak_std_m": None if band is None else band.peak_amplitude_std_m,
        "peak_frequency_std_hz": None if band is None else band.peak_frequency_std_hz,
        "peak_phase_lag_deg": peak.phase_lag_deg if reached else None,
        "folds_hz": response.fold_frequency_hz.tolist(),
        "detached_branches": int(response.branch.max()) if response.complete else 0,
        "range_use": float(response.range_use[response.branch == 0].max()),
        "error": None if error is None else error.row(),
        "notes": sorted(response.notes, key=lambda note: not note.startswith(CUT)),
    }


def _sweep(sweep: SweepPrediction, recorded: Transient | None, name: str) -> dict[str, Any]:
    peak_m, peak_hz = sweep.peak(recorded)
    return {
        "name": name,
        "origin": sweep.origin,
        "peak_m": peak_m,
        "peak_frequency_hz": peak_hz,
        "smallest_force_n": float(np.abs(sweep.force).min()),
        "range_use": sweep.range_use,
        "unbounded": sweep.unbounded_at_s is not None,
        "unbounded_at_s": sweep.unbounded_at_s,
        "notes": list(sweep.notes),
    }


def _summarise(predictions: Predictions) -> dict[str, Any]:
    known = (predictions.steady_bands, predictions.steady_references, predictions.steady_errors)
    steady = zip(predictions.steady, *known, strict=True)
    compared = zip(predictions.sweeps, predictions.sweep_errors, strict=True)
    names = [error.name if error else sweep.origin for sweep, error in compared]
    return {
        "specimen": predictions.specimen,
        "frequency_responses": [_steady(*each) for each in steady],
        "sweeps": [_sweep(*each) for each in zip(predictions.sweeps, predictions.sweep_references, names, strict=True)],
        "multisines": [run.row() for run in predictions.runs],
        "errors": [error.row() for error in predictions.errors],
        "notes": list(predictions.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    if summary["frequency_responses"]:
        compared = any(r["error"] for r in summary["frequency_responses"])
        print("frequency responses; +- are 95 % by the model's own errors")
        if compared:
            print("errors: predicted over reference, minus one")
        print_table(
            (
                *("response", "force N", "peak mm", "+-", "at Hz", "+-", "lag deg", "folds at Hz", "range use"),
                *(_ERRORS if compared else ()),
            ),
            [
                (
                    r["name"],
                    number(r["force_n"], ".4g"),
                    number(r["peak_m"], ".5f", 1e3) if r["peak_m"] else f">= {1e3 * r['largest_m']:.5f}",
                    number(r["peak_std_m"], ".2g", 1.96e3),
                    number(r["peak_frequency_hz"], ".4f"),
                    number(r["peak_frequency_std_hz"], ".2g", 1.96),
                    number(r["peak_phase_lag_deg"], ".1f"),
                    ", ".join(f"{fold:.4f}" for fold in r["folds_hz"]) or "none",
                    number(r["range_use"], ".2f"),
                    *(_errors(r["error"]) if compared else ()),
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
                    s["origin"] if s["origin"] != s["name"] else "the plan",
                    number(s["peak_m"], ".5f", 1e3),
                    number(s["peak_frequency_hz"], ".3f"),
                    number(s["smallest_force_n"], ".4f"),
                    "unbounded" if s["unbounded"] else number(s["range_use"], ".2f"),
                )
                for s in summary["sweeps"]
            ],
        )
    recorded = [run for run in summary["multisines"] if run["use"] != PLANNED]
    if recorded:
        print("multisines: relative errors, %")
        names = list(recorded[0]["errors"])
        print_table(
            ("realisation", "use", *names, "range use"),
            [
                (
                    r["name"],
                    r["use"],
                    *("-" if r["unbounded"] else number(r["errors"].get(name), ".3f", 100.0) for name in names),
                    "unbounded" if r["unbounded"] else number(r["range_use"], ".2f"),
                )
                for r in recorded
            ],
        )
        lost = sum(r["unbounded"] for r in recorded)
        if lost:
            print(f"{lost} of {len(recorded)} runs unbounded")
    _say_planned([run for run in summary["multisines"] if run["use"] == PLANNED])
    of_sweeps = summary["errors"][sum(bool(r["error"]) for r in summary["frequency_responses"]) :]
    if of_sweeps:
        print("errors: predicted over reference, minus one")
        print_table(
            ("prediction", *_ERRORS, "range use", ""),
            [
                (
                    e["name"],
                    *_errors(e),
                    "-" if e["verdict"] == "unbounded" else number(e["range_use"], ".2f"),
                    e["verdict"],
                )
                for e in of_sweeps
            ],
        )
    shown = set()
    for part in (*summary["frequency_responses"], *summary["sweeps"], *summary["errors"]):
        for note in part["notes"]:
            if note not in shown:
                print(f"note: {part['name']}: {note}")
            shown.add(note)


def _say_planned(runs: Sequence[dict[str, Any]]) -> None:
    """Print what the outputs reach in multisines that have not been measured."""
    if not runs:
        return
    print("planned multisines: RMS and largest value of the outputs, in their units")
    names = list(runs[0]["rms"])
    print_table(
        ("realisation", *(f"{name} {what}" for name in names for what in ("RMS", "largest")), "range use"),
        [
            (
                r["name"],
                *(number(r[which][name], ".4g") for name in names for which in ("rms", "peak")),
                "unbounded" if r["unbounded"] else number(r["range_use"], ".2f"),
            )
            for r in runs
        ],
    )


def _errors(error: dict[str, Any] | None) -> tuple[str, str, str]:
    """Return the errors of one prediction as they are printed."""
    if error is None:
        return "-", "-", "-"
    return (
        number(error["peak_error"], "+.2f", 100.0),
        number(error["peak_frequency_error"], "+.3f", 100.0),
        number(error["envelope_error"], ".2f", 100.0),
    )


TABLE = Table(_summarise, _say)
