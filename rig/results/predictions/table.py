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
from rig.text.column import Column
from rig.text.console import number, print_rows, print_table

PLANNED = "planned"
"""Use of a multisine that has not been measured."""
CUT = "the response from "
"""Beginning of the note on a response that was cut off. The note on the first path precedes that on the second."""
ERRORS = (
    Column("peak_error", "peak", "%", "+.2f", 100.0),
    Column("peak_frequency_error", "frequency", "%", "+.3f", 100.0),
    Column("envelope_error", "envelope", "%", ".2f", 100.0),
)
"""Columns of the errors of one prediction."""


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
        "peak_band_m": None if sweep.peak_band_m is None else list(sweep.peak_band_m),
        "peak_band_hz": None if sweep.peak_band_hz is None else list(sweep.peak_band_hz),
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
    multisines = summary["multisines"]
    _say_responses(summary["frequency_responses"])
    _say_sweeps(summary["sweeps"])
    _say_multisines([run for run in multisines if run["use"] != PLANNED])
    _say_planned([run for run in multisines if run["use"] == PLANNED])
    of_sweeps = summary["errors"][sum(bool(r["error"]) for r in summary["frequency_responses"]) :]
    if of_sweeps:
        print("errors: predicted over reference, minus one")
        print_rows(
            [{**e, "use": "-" if e["verdict"] == "unbounded" else number(e["range_use"], ".2f")} for e in of_sweeps],
            *(Column("name", "prediction"), *ERRORS, Column("use", "range use"), Column("verdict", "")),
        )
    shown = set()
    for part in (*summary["frequency_responses"], *summary["sweeps"], *summary["errors"]):
        for note in part["notes"]:
            if note not in shown:
                print(f"note: {part['name']}: {note}")
            shown.add(note)


def _say_responses(responses: Sequence[dict[str, Any]]) -> None:
    if not responses:
        return
    compared = any(one["error"] for one in responses)
    print("frequency responses; +- are 95 % by the model's own errors")
    if compared:
        print("errors: predicted over reference, minus one")
    none = dict.fromkeys(column.key for column in ERRORS)
    print_rows(
        [
            {
                **(one["error"] or none),
                **one,
                "peak": number(one["peak_m"], ".5f", 1e3) if one["peak_m"] else f">= {1e3 * one['largest_m']:.5f}",
                "folds": ", ".join(f"{fold:.4f}" for fold in one["folds_hz"]) or "none",
            }
            for one in responses
        ],
        Column("name", "response"),
        Column("force_n", "force", "N", ".4g"),
        Column("peak", "peak", "mm"),
        Column("peak_std_m", "+-", "", ".2g", 1.96e3),
        Column("peak_frequency_hz", "at", "Hz", ".4f"),
        Column("peak_frequency_std_hz", "+-", "", ".2g", 1.96),
        Column("peak_phase_lag_deg", "lag", "deg", ".1f"),
        Column("folds", "folds at", "Hz"),
        Column("range_use", "range use", "", ".2f"),
        *(ERRORS if compared else ()),
    )


def _say_sweeps(sweeps: Sequence[dict[str, Any]]) -> None:
    if not sweeps:
        return
    has_bands = any(one["peak_band_m"] for one in sweeps)
    print("sweeps; bands are 95 %" if has_bands else "sweeps")
    print_rows(
        [
            {
                **one,
                "from": one["origin"] if one["origin"] != one["name"] else "the plan",
                "use": _range_use(one),
                "band_m": _ends(one["peak_band_m"], ".5f", 1e3),
                "band_hz": _ends(one["peak_band_hz"], ".3f"),
            }
            for one in sweeps
        ],
        Column("name", "sweep"),
        Column("from", "from"),
        Column("peak_m", "peak", "mm", ".5f", 1e3),
        *([Column("band_m", "band")] if has_bands else []),
        Column("peak_frequency_hz", "at", "Hz", ".3f"),
        *([Column("band_hz", "band")] if has_bands else []),
        Column("smallest_force_n", "least force", "N", ".4f"),
        Column("use", "range use"),
    )


def _say_multisines(runs: Sequence[dict[str, Any]]) -> None:
    if not runs:
        return
    has_bands = any("error_band" in run for run in runs)
    print("multisines: relative errors, %" + ("; in brackets what 95 % do not exceed" if has_bands else ""))
    names = list(runs[0]["errors"])
    print_table(
        ("realisation", "use", *names, "range use"),
        [
            (
                *(r["name"], r["use"]),
                *("-" if r["unbounded"] else _with_band(r, name) for name in names),
                _range_use(r),
            )
            for r in runs
        ],
    )
    if lost := sum(r["unbounded"] for r in runs):
        print(f"{lost} of {len(runs)} runs unbounded")


def _say_planned(runs: Sequence[dict[str, Any]]) -> None:
    if not runs:
        return
    has_bands = any("rms_band" in run for run in runs)
    said = ", in brackets 95 % bands" if has_bands else ""
    print(f"planned multisines: RMS and largest value of the outputs, in their units{said}")
    names = list(runs[0]["rms"])
    print_table(
        ("realisation", *(f"{name} {what}" for name in names for what in ("RMS", "largest")), "range use"),
        [
            (r["name"], *(_in_band(r, which, name) for name in names for which in ("rms", "peak")), _range_use(r))
            for r in runs
        ],
    )


def _with_band(run: dict[str, Any], name: str) -> str:
    error = number(run["errors"].get(name), ".3f", 100.0)
    return f"{error} ({number(run['error_band'][name], '.3g', 100.0)})" if "error_band" in run else error


def _in_band(run: dict[str, Any], which: str, name: str) -> str:
    value = number(run[which][name], ".4g")
    return f"{value} ({_ends(run[f'{which}_band'][name], '.4g')})" if f"{which}_band" in run else value


def _ends(ends: Sequence[float] | None, form: str, scale: float = 1.0) -> str:
    return "-" if ends is None else " to ".join(number(end, form, scale) for end in ends)


def _range_use(run: dict[str, Any]) -> str:
    return "unbounded" if run["unbounded"] else number(run["range_use"], ".2f")


TABLE = Table(_summarise, _say)
