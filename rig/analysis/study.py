"""`Study`: a finished analysis that can be printed, drawn and converted to JSON; and helpers shared by its figures."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np

from rig.analysis.subject import Subject
from rig.drawing.style import Axes, Figure
from rig.text.json_values import JsonValue
from simulators.analysis import PeriodicResponses
from simulators.kernels import Flag
from vibrolock.arrays import Float
from vibrolock.printable import printable
from vibrolock.results import Result


def to_json(value: object) -> JsonValue:
    """Convert ``value``: arrays to lists, dataclasses to objects, complex numbers to ``[re, im]``."""
    if isinstance(value, PeriodicResponses):
        return _points(value)
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, np.ndarray):
        parts = np.stack([value.real, value.imag], axis=-1) if np.iscomplexobj(value) else value
        listed: JsonValue = parts.tolist()
        return listed
    if isinstance(value, np.generic):
        item: JsonValue = value.item()
        return item
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _points(responses: PeriodicResponses) -> list[JsonValue]:
    """Return one object per point with all its quantities; flags are given by name."""
    columns = {
        field.name: column
        for field in fields(responses)
        if field.name != "flags" and (column := getattr(responses, field.name)) is not None
    }
    return [
        {
            **{
                name: to_json({key: item[k] for key, item in column.items()} if isinstance(column, dict) else column[k])
                for name, column in columns.items()
            },
            "flags": [str(flag.name).lower() for flag in Flag if responses.flags[k] & int(flag)],
        }
        for k in range(responses.frequency_hz.size)
    ]


@dataclass(frozen=True, eq=False, kw_only=True)
class Study(Result, ABC):
    """One analysis of one bench."""

    subject: Subject
    """Bench and rig that were analysed."""
    notes: tuple[str, ...] = ()
    """Remarks on these numbers for the user, one line each."""
    complete: bool = True
    """Whether everything requested was found."""

    @property
    def figure_in(self) -> tuple[float, float]:
        """Width and height of the figure, inches."""
        return 9.0, 6.4

    @property
    @abstractmethod
    def title(self) -> str:
        """Title of the analysis in a few words."""

    @abstractmethod
    def numbers(self) -> dict[str, object]:
        """Return all numbers by name: arrays, dataclasses, dictionaries and lists of them."""

    @abstractmethod
    def print_tables(self) -> None:
        """Print tables for a person."""

    @abstractmethod
    def draw_on(self, page: Figure) -> None:
        """Draw on an empty page."""

    def summary(self) -> dict[str, JsonValue]:
        """Return everything as one JSON object; a complex number is a list of real and imaginary part."""
        bench = self.subject.bench
        modes, mode = self.subject.rig.linear_modes, self.subject.mode
        head: dict[str, object] = {
            "kind": "analysis",
            "analysis": type(self).__name__,
            "bench": bench.name,
            "specimen": bench.specimen.name,
            "mode": {
                "number": mode + 1,
                "frequency_hz": modes.frequency_hz[mode],
                "damping_ratio": modes.damping_ratio[mode],
                "drive_shape": modes.drive_shape[mode],
            },
            "nominal": True,
            "complete": self.complete,
            "notes": [*self.subject.notes, *self.notes],
        }
        return {name: to_json(value) for name, value in (head | self.numbers()).items()}

    def print_summary(self) -> None:
        """Print title, tables and notes."""
        bench = self.subject.bench
        print(printable(f"{bench.specimen.name} (bench {bench.name}): {self.title}"))
        self.print_tables()
        for note in (*self.subject.notes, *self.notes):
            print(printable(f"note: {note}"))


def draw(study: Study, figure: Path) -> None:
    """Draw an analysis into ``figure`` (png, pdf or svg, by its suffix); raise `RecordingError` if it cannot be written."""
    from rig.drawing.page import check_ending, check_replaceable, page_for
    from rig.drawing.style import title

    check_ending(figure)
    check_replaceable(figure)
    with page_for(figure, study.figure_in) as page:
        study.draw_on(page)
        title(page, f"{study.subject.bench.specimen.name}: {study.title}")


def length_unit(largest_m: float) -> tuple[float, str]:
    """Return factor and name of the unit for displacements up to ``largest_m``."""
    return (1e6, "µm") if largest_m < 5e-4 else (1e3, "mm")


def set_min_span(axis: Axes, values: Float, smallest: float) -> None:
    """Let the y axis span at least ``smallest`` times its middle value, so that small changes look small."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    middle, half = 0.5 * (low + high), 0.55 * (high - low)
    half = max(half, 0.5 * smallest * abs(middle))
    axis.set_ylim(middle - half, middle + half)
