"""Brake-Reuss beam, measured: the mode of response-controlled stepped sines predicts the force-controlled ones.

Data and tests: W. Chen et al., Measurement and identification of the nonlinear dynamics of a jointed structure using full-field
data; Part I, Mechanical Systems and Signal Processing 166, 2022, 108401.
"""

from pathlib import Path

import numpy as np

from identification import (
    FrequencyResponse,
    NonlinearMode,
    PredictionError,
    SteadyPrediction,
    compare,
    frequency_response,
    recorded_force_response,
    stepped_sine_mode,
)
from rig.exchange.reading import read_frequency_responses
from rig.text.column import Column
from studies.reproduce.references.data import DataFile, DataSet
from studies.reproduce.references.result import Curve, Line, Panel, ReferenceStudy, Say, StudyResult

_MAPPING = Path(__file__).with_name("brake-reuss-mapping.toml")
_WINDOW_DEG = 60.0
"""Distance from phase resonance within which a response to the recorded force is compared."""


def _study(paths: tuple[Path, ...], models: int, seed: int, say: Say) -> StudyResult:
    measured = read_frequency_responses(paths[0], _MAPPING)
    mode = stepped_sine_mode(measured)
    lines, panels = [], [_backbone(mode)]
    for reference in (one for one in measured if one.controlled == "force"):
        force_n = float(np.median(reference.force_n))
        held = frequency_response(mode, force_n, points=401)
        point_by_point = recorded_force_response(mode, reference)
        both = (
            compare(held, reference).error,
            compare(point_by_point, reference, phase_window_deg=_WINDOW_DEG).error,
        )
        lines.append(Line(f"{force_n:.2f} N", _figures(*both)))
        panels.append(_response(held, point_by_point, reference, force_n))
    return StudyResult(
        title="Brake-Reuss beam, force-controlled responses predicted from response-controlled ones",
        columns=(
            Column("peak_percent", "peak, %", pattern="+.2f"),
            Column("frequency_percent", "its frequency, %", pattern="+.3f"),
            Column("recorded_peak_percent", "peak at the recorded force, %", pattern="+.2f"),
            Column("recorded_frequency_percent", "frequency there, %", pattern="+.3f"),
            Column("recorded_envelope_percent", "envelope there, %", pattern=".2f"),
            Column("range_use", "range use", pattern=".2f"),
        ),
        lines=tuple(lines),
        notes=(
            "errors of predictions relative to the measured force-controlled responses, at the median of their force and, "
            "point by point, at the recorded one",
            f"mode of {mode.frequency_hz.size} response-controlled levels: "
            + ", ".join(
                f"{f:.2f} Hz {100 * z:.3f} %" for f, z in zip(mode.frequency_hz, mode.damping_ratio, strict=True)
            ),
            "no published prediction of these responses is known to us: the reference is what was measured",
        ),
        panels=tuple(panels),
        models={"mode": mode},
    )


def _figures(held: PredictionError, recorded: PredictionError) -> dict[str, float]:
    found = {
        "peak_percent": held.peak_error,
        "frequency_percent": held.peak_frequency_error,
        "recorded_peak_percent": recorded.peak_error,
        "recorded_frequency_percent": recorded.peak_frequency_error,
        "recorded_envelope_percent": recorded.envelope_error,
    }
    return {**{key: 100.0 * value for key, value in found.items()}, "range_use": held.range_use}


def _backbone(mode: NonlinearMode) -> Panel:
    return Panel(
        "modal frequency, Hz",
        "displacement, um",
        (Curve("mode of the response-controlled levels", mode.frequency_hz, 1e6 * mode.amplitude_m, "backbone"),),
    )


def _response(
    held: SteadyPrediction, recorded: SteadyPrediction, reference: FrequencyResponse, force_n: float
) -> Panel:
    low, high = reference.frequency_hz.min(), reference.frequency_hz.max()
    near = (held.frequency_hz >= low) & (held.frequency_hz <= high)
    return Panel(
        "frequency, Hz",
        f"displacement at {force_n:.2f} N, um",
        (
            Curve("measured", reference.frequency_hz, 1e6 * reference.amplitude_m, "points"),
            Curve("predicted at this force", held.frequency_hz[near], 1e6 * held.amplitude_m()[near]),
            Curve("predicted at the recorded force", recorded.frequency_hz, 1e6 * recorded.amplitude_m(), "residual"),
        ),
    )


BRAKE_REUSS = ReferenceStudy(
    DataSet(
        name="brake-reuss",
        files=(
            DataFile(
                name="ForcedFrequencyResponses.mat",
                sha256="e4bfe248b921edbd23153c24a37c3a9e1556fb1bf59fe6d9e63ae8e2177f1100",
            ),
        ),
        source="https://github.com/mattiacenedese/BRBtesting",
        citation="W. Chen et al., Mechanical Systems and Signal Processing 166, 2022, 108401, doi 10.1016/j.ymssp.2021.108401",
    ),
    _study,
)
