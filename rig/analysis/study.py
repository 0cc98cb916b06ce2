"""A finished analysis: something that can be printed, drawn and turned into JSON."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.analysis.plain import plain
from rig.analysis.subject import Subject
from rig.errors import RecordingError
from rig.text.printable import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Study", "check_ending", "draw"]

FIGURE_ENDINGS = (".png", ".pdf", ".svg")


@dataclass(frozen=True, eq=False, kw_only=True)
class Study(ABC):
    """One analysis of one bench."""

    subject: Subject
    """What was analysed."""
    notes: tuple[str, ...] = ()
    """What a user should know about these numbers, one line each."""
    complete: bool = True
    """Whether everything that was asked for was found."""

    @property
    def figure_in(self) -> tuple[float, float]:
        """Width and height of the figure, inches."""
        return 9.0, 6.4

    @property
    @abstractmethod
    def title(self) -> str:
        """What this is, in a few words."""

    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """All numbers by name: arrays, dataclasses, dictionaries and lists of them."""

    @abstractmethod
    def print_tables(self) -> None:
        """Print what a person wants to read."""

    @abstractmethod
    def draw_on(self, page: "Figure") -> None:
        """Draw on an empty page."""

    def summary(self) -> dict[str, Any]:
        """Everything in one JSON-able dictionary; a complex number is a list of real and imaginary part."""
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
    """Draw an analysis into ``figure`` (png, pdf or svg by its ending); `RecordingError` where it cannot be written."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from rig.figures.style import STYLE

    check_ending(figure)
    with mpl.rc_context(STYLE):
        page = Figure(figsize=study.figure_in, layout="constrained")
        study.draw_on(page)
        page.suptitle(f"{study.subject.bench.specimen.name}: {study.title}", fontsize=11, x=0.01, ha="left")
        try:
            page.savefig(figure)
        except OSError as error:
            raise RecordingError(f"{figure}: cannot be written: {error.strerror}") from None


def check_ending(figure: Path) -> None:
    """`RecordingError` unless ``figure`` ends like a figure that can be drawn."""
    if figure.suffix.lower() not in FIGURE_ENDINGS:
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")
