"""How the curves of files look that are laid over one another: colour, marker and line of each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rig.drawing.areas import broad
from rig.drawing.curves import Curves, Origin
from rig.drawing.style import COLOURS, MARKERS, rc, shade

DENSE = 80
"""Measured curves with more points are drawn without markers."""
LINES = ("-", "--", "-.", ":")
UNBROKEN = 3
"""Number of `LINES` for models, whose unstable parts are dotted."""
REFERENCE = "#000000"


@dataclass(frozen=True)
class Look:
    """How one trace is drawn."""

    colour: Any
    marker: str
    line: str | tuple[int, tuple[float, float]]
    size: float = 1.0
    """Of its markers, over the usual size: earlier files have larger ones, which later ones do not hide."""
    hollow: bool = False
    """Whether its markers are open, so that those of other files below are seen."""
    behind: bool = False
    """Whether it is a broad and pale line behind those of models."""

    def style(self) -> dict[str, Any]:
        """Return the settings of a line of matplotlib."""
        style = {"color": self.colour, "marker": self.marker, "ls": self.line}
        style["markersize"] = self.size * rc("lines.markersize")
        if self.hollow:
            style["mfc"] = "none"
        if self.behind:
            style |= {"lw": broad(), "alpha": 0.4, "zorder": 1.5}
        return style


class Looks:
    """The looks of all curves of some files.

    Files differ in colour. Levels differ in their marker or, of dense curves and of models, in their line; a single file's
    levels also in colour. Measurements are markers and models lines where there are both.
    """

    def __init__(self, found: Sequence[Curves]) -> None:
        traces = [trace for curves in found for trace in curves.traces]
        named = dict.fromkeys(trace.level for trace in traces if trace.level)
        each = max(len({trace.level for trace in curves.traces}) for curves in found)
        self.levels = list(named) if named and (each > 1 or len(found) == 1) else [""]
        """Names of the levels; one empty name if there are none, or one in each of several files."""
        self.files = len(found)
        self.of_model = [any(trace.origin == "model" for trace in curves.traces) for curves in found]
        self.dense = any(line.x.size > DENSE for trace in traces if trace.origin != "model" for line in trace.lines)

    @property
    def several(self) -> bool:
        """Whether there are several levels."""
        return len(self.levels) > 1

    def of(self, number: int, level: str, origin: Origin) -> Look:
        """Return the look of a level of a file, by the file's number and what its curves come from."""
        at = self.levels.index(level) if level in self.levels else 0
        colour = self._colour(number, at)
        if origin == "model":
            kind = at if self.several else sum(self.of_model[:number])
            return Look(colour, "", LINES[kind % UNBROKEN])
        kind = at if self.several or origin == "reference" else number
        models = any(self.of_model)
        if self.dense:
            return Look(colour, "", "-" if models or self.files == 1 else LINES[kind % len(LINES)], behind=models)
        marker = MARKERS[kind] if kind < len(MARKERS) else "."
        if origin == "reference":
            return Look(REFERENCE, marker, "", hollow=True)
        size = 1.0 + 0.6 * (self.files - 1 - number) / max(1, self.files - 1)
        return Look(colour, marker, "" if models else "-", size, hollow=number > 0)

    def _colour(self, number: int, at: int) -> Any:
        if self.files > 1:
            return COLOURS[number % len(COLOURS)]
        return shade(at, len(self.levels)) if self.several else COLOURS[0]
