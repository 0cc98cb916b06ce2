"""`Study`: a finished analysis that can be printed, drawn and converted to JSON; and helpers shared by its figures."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.analysis.subject import Subject
from rig.errors import RecordingError
from simulators.analysis import PeriodicResponses
from simulators.kernels import Flag
from vibrolock.printable import printable
from vibrolock.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plain(value: Any) -> Any:
    """Convert ``value``: arrays to lists, dataclasses to dictionaries, complex numbers to ``[re, im]``."""
    if isinstance(value, PeriodicResponses):
        return points_of(value)
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        parts = np.stack([value.real, value.imag], axis=-1) if np.iscomplexobj(value) else value
        return parts.tolist()
    return value.item() if isinstance(value, np.generic) else value


def points_of(responses: PeriodicResponses) -> list[dict[str, Any]]:
    """Return one dictionary per point with all its quantities; flags are given by name."""
    columns: dict[str, Any] = {
        field.name: getattr(responses, field.name)
        for field in fields(responses)
        if field.name != "flags" and getattr(responses, field.name) is not None
    }
    return [
        {
            **{
                name: plain({key: item[k] for key, item in column.items()} if isinstance(column, dict) else column[k])
                for name, column in columns.items()
            },
            "flags": [str(flag.name).lower() for flag in Flag if responses.flags[k] & int(flag)],
        }
        for k in range(responses.frequency_hz.size)
    ]


FIGURE_ENDINGS = (".png", ".pdf", ".svg")


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
    def numbers(self) -> dict[str, Any]:
        """Return all numbers by name: arrays, dataclasses, dictionaries and lists of them."""

    @abstractmethod
    def print_tables(self) -> None:
        """Print tables for a person."""

    @abstractmethod
    def draw_on(self, page: "Figure") -> None:
        """Draw on an empty page."""

    def summary(self) -> dict[str, Any]:
        """Return everything in one JSON-able dictionary; a complex number is a list of real and imaginary part."""
        bench = self.subject.bench
        modes, mode = self.subject.rig.linear_modes, self.subject.mode
        head = {
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
        return dict(plain(head | self.numbers()))

    def say(self) -> None:
        """Print title, tables and notes."""
        bench = self.subject.bench
        print(printable(f"{bench.specimen.name} (bench {bench.name}): {self.title}"))
        self.print_tables()
        for note in (*self.subject.notes, *self.notes):
            print(printable(f"note: {note}"))


def draw(study: Study, figure: Path) -> None:
    """Draw an analysis into ``figure`` (png, pdf or svg, by its suffix); raise `RecordingError` if it cannot be written."""
    from rig.drawing.page import check_replaceable, page_for
    from rig.drawing.style import title

    check_ending(figure)
    check_replaceable(figure)
    with page_for(figure, study.figure_in) as page:
        study.draw_on(page)
        title(page, f"{study.subject.bench.specimen.name}: {study.title}")


def check_ending(figure: Path) -> None:
    """Raise `RecordingError` unless the suffix of ``figure`` is that of a figure format."""
    if figure.suffix.lower() not in FIGURE_ENDINGS:
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")


def length_unit(largest_m: float) -> tuple[float, str]:
    """Return factor and name of the unit for displacements up to ``largest_m``."""
    return (1e6, "µm") if largest_m < 5e-4 else (1e3, "mm")


def roomy(axis: "Axes", values: NDArray[np.float64], least_share: float) -> None:
    """Let the y axis span at least a given share of its middle value, so that small changes look small."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    middle, half = 0.5 * (low + high), 0.55 * (high - low)
    half = max(half, 0.5 * least_share * abs(middle))
    axis.set_ylim(middle - half, middle + half)
