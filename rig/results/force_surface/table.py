"""Files of force surfaces. They contain the measured levels; the surface is fitted again on each use."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import FrequencyResponse
from rig.results.force_surface.model import MeasuredSurface
from rig.results.kind import Table
from rig.text.column import Column
from rig.text.console import print_rows


def _summarise(measured: MeasuredSurface) -> dict[str, Any]:
    surface = measured.surface
    resonance = surface.at_lag(90.0)
    points = _points_at(measured.responses, surface.amplitude_m)
    levels = [
        {
            "amplitude_m": float(fit.amplitude_m),
            "points": points[index],
            "frequency_hz": None,
            "force_n": None,
            "fit_residual": float(fit.residual),
        }
        for index, fit in enumerate(surface.levels)
    ]
    for amplitude, frequency, force in zip(
        resonance.amplitude_m, resonance.frequency_hz, resonance.force_n, strict=True
    ):
        at = int(np.argmin(np.abs(surface.amplitude_m - amplitude)))
        levels[at] |= {"frequency_hz": float(frequency), "force_n": float(force)}
    return {
        "specimen": surface.specimen,
        "levels": levels,
        "next_level_m": surface.next_level_m(),
        "notes": list(measured.notes),
    }


def _points_at(responses: Sequence[FrequencyResponse], amplitudes_m: np.ndarray) -> list[int]:
    nearest = [int(np.argmin(np.abs(amplitudes_m - response.level))) for response in responses]
    return [
        sum(response.frequency_hz.size for response, at in zip(responses, nearest, strict=True) if at == index)
        for index in range(amplitudes_m.size)
    ]


def _say(summary: dict[str, Any]) -> None:
    print(f"{len(summary['levels'])} levels of displacement; at phase resonance:")
    print_rows(
        summary["levels"],
        Column("amplitude_m", "level", "mm", ".5f", 1e3),
        Column("points", "points"),
        Column("frequency_hz", "frequency", "Hz", ".4f"),
        Column("force_n", "force", "N", ".4f"),
        Column("fit_residual", "fit leaves", "%", ".3f", 100.0),
    )
    print(f"one more level would help most at {1e3 * summary['next_level_m']:.4g} mm")


TABLE = Table(_summarise, _say)
