"""Frequency responses from the points of a recording, for every kind of campaign that steps through frequencies or lags."""

from collections.abc import Iterable

import numpy as np

from identification import FrequencyResponse, IdentificationError
from identification.common import Controlled
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.recording.reader import Recording

CONTROLLED: dict[str, Controlled] = {"V": "voltage", "N": "force", "N RMS": "none", "m": "response"}
"""The controlled quantity, by the unit of the levels."""


def recorded_frequency_responses(recording: Recording) -> tuple[FrequencyResponse, ...]:
    """Return the accepted points of a recording as one frequency response per level and pass, in the order of measurement.

    If the RMS of the force was held, no fundamental is constant and ``controlled`` is ``"none"``. Raises `IdentificationError`
    if no point was accepted.
    """
    roles = [channel["role"] for channel in recording.channels]
    force, drive = roles.index("force"), roles.index("drive")
    out = []
    for label, accepted in passes_of(points_of(recording)):
        level, unit = accepted[0].level, accepted[0].level_unit
        frequency_hz = np.array([vibration_of(point).frequency_hz for point in accepted])
        fundamentals = np.array([spectrum_of(point).harmonics[:, 1] for point in accepted])
        response = fundamentals[:, drive]
        if unit == "m":
            response = response * (-1.0 / (2.0 * np.pi * frequency_hz) ** 2)
        out.append(
            FrequencyResponse(
                frequency_hz=frequency_hz,
                force=fundamentals[:, force],
                response=response,
                kind="displacement" if unit == "m" else "acceleration",
                controlled=CONTROLLED[unit],
                level=level,
                label=label,
                specimen=specimen_of(recording),
            )
        )
    return tuple(out)


def passes_of(points: Iterable[Point[object]]) -> list[tuple[str, list[Point[object]]]]:
    """Return the name and the accepted points of each level and pass, in the order of measurement.

    The name is the level, with direction and repeat where passes at the same level differ in them. Raises
    `IdentificationError` if no point was accepted.
    """
    passes: dict[tuple[float, str, int, str], list[Point[object]]] = {}
    for point in without_repetition(points):
        if point.accepted:
            passes.setdefault((point.level, point.direction, point.repeat, point.level_unit), []).append(point)
    IdentificationError.raise_if(not passes, "none of the recording was accepted", field="points")
    out = []
    for (level, direction, repeat, unit), accepted in passes.items():
        alike = [one for one in passes if one[0] == level]
        label = f"{1e3 * level:.4g} mm" if unit == "m" else f"{level:g} {unit}"
        label += f" {direction}" if len({one[1] for one in alike}) > 1 else ""
        label += f" {repeat}" if len({one[2] for one in alike}) > 1 else ""
        out.append((label, accepted))
    return out
