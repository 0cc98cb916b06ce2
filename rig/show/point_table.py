"""The table of points of a recording, and what is to be said of its points, as `rig show` and reports have them."""

from collections.abc import Mapping, Sequence
from typing import Any

from rig.campaigns.evaluation.point import Attempt, Point, point_name
from rig.campaigns.evaluation.stored_point import point_from, value_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.show.point_warnings import quality_in_short
from rig.show.progress import value_text
from rig.text.column import Column
from rig.text.levels import level_text


def points_from(kind: str, tables: Sequence[Mapping[str, Any]]) -> list[Point[object]]:
    """Return the points of a summary of a recording as objects."""
    result: type[Any] = CAMPAIGNS[kind].result
    return [point_from({key: value for key, value in one.items() if value is not None}, result) for one in tables]


def shown_columns(kind: str, points: Sequence[Point[object]]) -> list[Column]:
    """Return the columns of a kind, without optional ones that no point has a value for."""
    return [
        column
        for column in CAMPAIGNS[kind].columns
        if not column.optional or any(value_of(point, column.key) is not None for point in points)
    ]


def point_rows(points: Sequence[Point[object]], columns: Sequence[Column]) -> list[tuple[str, ...]]:
    """Return for each point: number counted from 1, level, its unit, the columns, whether it settled, and quality."""
    return [
        (
            str(point.number + 1),
            *level_text(point.level, point.level_unit).split(" ", 1),
            *(value_text(column, point) for column in columns),
            {True: "yes", False: "no", None: "-"}[point.settled],
            quality_in_short(point),
        )
        for point in points
    ]


def attempts_refused(point: Point[object]) -> list[str]:
    """Return one line for each attempt at a point that was refused before the one that the table shows."""
    return [
        f"{point_name(point.number)}: attempt {number} refused{_where(attempt)}: {attempt.reason}"
        for number, attempt in enumerate(point.refused_before, 1)
    ]


def _where(attempt: Attempt) -> str:
    told = [
        f"{value:.4g} {unit}"
        for value, unit in ((attempt.frequency_hz, "Hz"), (attempt.force_n, "N"))
        if value is not None
    ]
    return f" at {', '.join(told)}" if told else ""
