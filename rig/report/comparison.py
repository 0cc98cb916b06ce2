"""The chapter on several recordings of one kind: an overview, and their points over one another."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.stored_point import value_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.check.findings import is_check
from rig.drawing.style import COLOURS, MARKERS, REJECTED, Axes, Figure, title, unit_text
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.report.document import Chapter, Section, Table
from rig.report.facts import endings
from rig.report.pictures import Pictures
from rig.results.kinds import KINDS
from rig.show.point_table import points_from
from rig.show.summary import summarise_recording
from rig.text.column import Column
from vibrolock.arrays import Float

MAX_PANELS = 3  # quantities that are compared; chosen
_LEVEL = Column("level", "level", "", ".4g")


@dataclass(frozen=True)
class _Compared:
    """A recording as the comparison needs it."""

    name: str
    row: tuple[str, ...]
    points: Sequence[Point[object]]


def comparisons(paths: Sequence[Path], pictures: Pictures) -> list[Chapter]:
    """Return one chapter for every kind of campaign that several of the files are recordings of."""
    kinds: dict[str, list[Path]] = {}
    for path in paths:
        kind = kind_of(path)
        if kind not in KINDS:
            with Recording(path) as recording:
                if not is_check(recording):
                    kinds.setdefault(kind, []).append(path)
    return [_chapter(kind, some, pictures) for kind, some in kinds.items() if len(some) > 1]


def _chapter(kind: str, paths: Sequence[Path], pictures: Pictures) -> Chapter:
    found = [_compared(path) for path in paths]
    headings = ("recording", "specimen", "bench", "started", "seed", "accepted", "how it ended")
    x, ys = panels(CAMPAIGNS[kind].columns)
    picture = pictures.drawn(
        lambda page: _draw(page, kind, found), (9.0, 2.6 * len(ys) + 0.8), f"Points of {len(paths)} {kind} recordings."
    )
    caption = f"{len(paths)} recordings of kind {kind}"
    what = ", ".join(y.heading for y in ys)
    sections = [
        Section("Recordings", [Table(caption, headings, [one.row for one in found])]),
        Section(f"Their points: {what} over {x.heading}", [picture]),
    ]
    return Chapter(f"Comparison of {len(found)} {kind} recordings", ", ".join(one.name for one in found), [], sections)


def _compared(path: Path) -> _Compared:
    with Recording(path) as recording:
        summary = summarise_recording(recording)
        points = points_from(recording.kind, summary["points"])
        accepted = f"{sum(point.accepted for point in points)} of {summary['points_planned']}"
        seed = "-" if recording.seed is None else str(recording.seed)
        row = (
            *(path.name, summary["specimen"], summary["bench"], recording.started.replace("T", " "), seed, accepted),
            "; ".join(endings(recording)),
        )
        return _Compared(path.name, row, points)


def panels(columns: Sequence[Column]) -> tuple[Column, list[Column]]:
    """Return which column of a kind is drawn along x, and which ones are drawn over it.

    Cycles where there are some; the frequency where the phase lag is what changes; else the amplitude of the vibration; the
    level where a point is no single vibration.
    """
    wanted: tuple[str, ...]
    known = {column.key: column for column in columns if column.heading != "+-"}
    if "cycles" in known:
        x, wanted = known["cycles"], ("frequency_hz", "damping_ratio", "amplitude_m")
    elif "phase_lag_deg" in known or "asked_phase_lag_deg" in known:
        x, wanted = known["frequency_hz"], ("amplitude_m", "force_n", "phase_lag_deg", "asked_phase_lag_deg")
    elif {"frequency_hz", "amplitude_m"} <= set(known):
        x, wanted = known["amplitude_m"], ("frequency_hz", "damping_ratio", "force_n")
    else:
        x, wanted = _LEVEL, tuple(key for key, column in known.items() if not column.counts_from)
    return x, [known[key] for key in wanted if key in known][:MAX_PANELS]


def _draw(page: Figure, kind: str, found: Sequence[_Compared]) -> None:
    """Draw the points of the recordings over one another; those that are not accepted are small and hollow."""
    columns = CAMPAIGNS[kind].columns
    x, ys = panels(columns)
    axes = page.subplots(len(ys), 1, sharex=True, squeeze=False)[:, 0]
    spread = {before.key: one for before, one in pairwise(columns) if one.heading == "+-"}
    for axis, y in zip(axes, ys, strict=True):
        for n, one in enumerate(found):
            _panel(axis, one, n, x, y, spread.get(y.key))
        axis.set_ylabel(f"{y.heading}, {unit_text(y.unit)}".removesuffix(", "))
    unit = next((point.level_unit for one in found for point in one.points), "") if x is _LEVEL else x.unit
    axes[-1].set_xlabel(f"{x.heading}, {unit}".removesuffix(", "))
    for text in axes[0].legend(fontsize=8).get_texts():
        text.set_parse_math(False)
    title(page, f"{kind}: {len(found)} recordings")


def _panel(axis: Axes, one: _Compared, n: int, x: Column, y: Column, spread: Column | None) -> None:
    colour, marker = COLOURS[n % len(COLOURS)], MARKERS[n % len(MARKERS)]
    used = [point for point in one.points if point.accepted]
    errors = None if spread is None else _values(used, spread)
    look: dict[str, Any] = {"fmt": marker, "ms": 4.5, "mfc": "none" if n else colour, "capsize": 2, "elinewidth": 0.9}
    axis.errorbar(_values(used, x), _values(used, y), errors, color=colour, label=one.name, **look)
    refused = [point for point in one.points if not point.accepted]
    axis.plot(_values(refused, x), _values(refused, y), marker, ms=3, mfc="none", color=REJECTED)


def _values(points: Sequence[Point[object]], column: Column) -> Float:
    """Return the values of a column in its unit, float64[points]; NaN where a point has none."""
    if column is _LEVEL:
        return np.array([point.level for point in points], float)
    found = [value_of(point, column.key) for point in points]
    return column.scale * np.array([np.nan if value is None else value + column.counts_from for value in found], float)
