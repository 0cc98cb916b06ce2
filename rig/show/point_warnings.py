"""Warnings of points as people read them: in short beside a point, and once for all points that have the same."""

import re
from collections.abc import Iterable, Sequence

from rig.campaigns.evaluation.point import Point, Quality
from rig.campaigns.evaluation.vibration_quality import FORCE_HARMONICS

_NUMBER = re.compile(r"(?<![\w.])(?<!harmonic )(?<!harmonics )[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?!\w|\.\d)")
"""A number that may differ from point to point; names with digits and numbers of harmonics are no such numbers."""


def in_short(warning: str) -> str:
    """Return a warning without what stands behind its first colon."""
    return warning.partition(": ")[0]


def quality_in_short(point: Point[object]) -> str:
    """Return the quality of a point and, where it is accepted with warnings, their short forms."""
    if point.quality is not Quality.WARNED or not point.warnings:
        return str(point.quality)
    return f"{point.quality}: {', '.join(dict.fromkeys(map(in_short, point.warnings)))}"


def warnings_together(points: Iterable[Point[object]]) -> list[str]:
    """Return each kind of warning once, after the names of its points: ``points 7 to 9: a lag scatters by 6.1 to 7.2 deg``."""
    return _together((point.number, text) for point in points for text in point.warnings or ())


def notes_together(points: Iterable[Point[object]]) -> list[str]:
    """Return each kind of note on points once, after their names."""
    return _together((point.number, text) for point in points for text in point.notes)


def _together(said: Iterable[tuple[int, str]]) -> list[str]:
    alike: dict[str, list[tuple[int, str]]] = {}
    for number, text in said:
        alike.setdefault(_NUMBER.sub("0", text), []).append((number, text))
    return [
        f"{points_named([number for number, _ in group])}: {_merged([t for _, t in group])}" for group in alike.values()
    ]


def _merged(texts: Sequence[str]) -> str:
    """Return texts that differ in numbers only as one, with the least and the largest of each number."""
    found = [_NUMBER.findall(text) for text in texts]
    ranges = iter([sorted(set(column), key=lambda one: abs(float(one))) for column in zip(*found, strict=True)])

    def put(_: re.Match[str]) -> str:
        values = next(ranges)
        return values[0] if len(values) == 1 else f"{values[0]} to {values[-1]}"

    return _NUMBER.sub(put, texts[0])


def points_named(numbers: Sequence[int]) -> str:
    """Return names of points that count from 0, as people read them: ``point 3``, ``points 1, 2 and 7 to 13``."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [
        part
        for run in runs
        for part in ([f"{run[0] + 1} to {run[-1] + 1}"] if len(run) > 2 else [str(number + 1) for number in run])
    ]
    if len(parts) == 1:
        return f"point{'s' if ' to ' in parts[0] else ''} {parts[0]}"
    return f"points {', '.join(parts[:-1])} and {parts[-1]}"


def what_warnings_mean(points: Iterable[Point[object]], pure_plan: str) -> str:
    """Return one line on the points that were accepted with warnings, empty if there are none.

    ``pure_plan`` says which plan avoids harmonics of the force; it is said if a point has a warning about them.
    """
    warnings = [text for point in points if point.accepted for text in point.warnings or ()]
    if not warnings:
        return ""
    harmonic = pure_plan and any(text.startswith(FORCE_HARMONICS) for text in warnings)
    return "warned points count (`rig docs warned` explains)" + (f"; {pure_plan}" if harmonic else "")
