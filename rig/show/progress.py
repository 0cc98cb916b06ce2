"""Progress on the terminal: points of a run, iterations of a fit. Without a terminal, only plain lines are written."""

import contextlib
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rig.campaigns.evaluation.point import Point, Quality
from rig.campaigns.evaluation.stored_point import value_of
from rig.show.point_warnings import quality_in_short
from rig.show.waiting import heard, say_beside
from rig.text.console import number
from rig.text.durations import duration
from rig.text.levels import level_text
from vibrolock.printable import printable

if TYPE_CHECKING:
    import numpy as np

    from identification import FitProgress
    from rig.text.column import Column
    from rig.tick.tick import Tick

LOCK_WORDS = ("searching", "acquiring", "locked", "lost")


def value_text(column: "Column", point: Point[object]) -> str:
    """Format a quantity of a point without its unit; return a dash if there is no value."""
    value = value_of(point, column.key)
    return number(None if value is None else value + column.counts_from, column.pattern, column.scale)


def _in_a_line(column: "Column", point: Point[object]) -> str:
    """Format a quantity of a point with its unit. The heading is left out where the unit already identifies the quantity."""
    text = f"{value_text(column, point):>8} {column.unit}".rstrip()
    return text if column.plain else f"{column.heading} {text}"


class _StatusLine:
    """A line at the bottom of a terminal. An output whose reader has gone is no error: what is shown continues."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()

    def close(self) -> None:
        """Clear the status line."""
        if self._terminal:
            self._status("")

    def _status(self, text: str) -> None:
        heard()
        with contextlib.suppress(OSError):
            sys.stderr.write(f"\r\x1b[2K{text}")
            sys.stderr.flush()

    def _print(self, line: str) -> None:
        heard()
        self.close()
        with contextlib.suppress(OSError):
            print(printable(line), file=sys.stderr, flush=True)


class RunProgress(_StatusLine):
    """Writes a line for each point and, on a terminal, a status line below that follows the loop."""

    def __init__(self, columns: "Sequence[Column]" = ()) -> None:
        super().__init__()
        self._columns = columns
        self._finished = 0

    def point(self, point: Point[object], number_done: int, total: int) -> None:
        """Print the line of a point."""
        self._finished = number_done
        of = f"/{total}" if point.number < total else ""  # a changed plan continues the numbering of earlier plans
        parts = [f"point {point.number + 1:>3}{of}  {level_text(point.level, point.level_unit, '>7.4g')}"]
        if point.evaluated:
            shown = [c for c in self._columns if c.in_line and not (c.optional and value_of(point, c.key) is None)]
            parts += [_in_a_line(column, point) for column in shown]
            if point.settle_periods is not None:
                parts.append(f"settled in {number(point.settle_periods, '.0f'):>4} periods")
        if point.attempts > 1:
            parts.append(f"attempt {point.attempts}")
        if point.quality is not Quality.GOOD:
            why = f": {point.reason}" if point.reason not in ("", point.quality) else ""
            parts.append(quality_in_short(point) + why)
        self._print("  ".join(parts))

    def advance(self, rows: "np.ndarray", tick: "Tick") -> None:
        """Update the status line."""
        if not self._terminal:
            return
        last = rows[-1]
        seconds = tick.sample / tick.bench.sample_rate_hz
        state = LOCK_WORDS[int(last["lock"])]
        self._status(
            f"{seconds:8.1f} s  {float(last['frequency_hz']):9.4f} Hz  "
            f"{abs(complex(last['command_v'])):7.4f} V  {state}  {self._finished} points done"
        )

    def remark(self, text: str) -> None:
        """Print a remark of the driver on the bench."""
        self._print(f"note: {text}")


class FitLines(_StatusLine):
    """Shows the progress of a fit: a status line on a terminal, otherwise a line per ten iterations or ten seconds.

    ``check`` is called at every iteration and may raise an error to end the fit.
    """

    _EVERY, _LONGEST_S = 10, 10.0

    def __init__(self, check: "Callable[[], None]" = lambda: None) -> None:
        super().__init__()
        self._check = check
        self._best = (float("inf"), 0)
        self._stage = ""
        self._said_s = 0.0
        self._usual = ""

    def __call__(self, at: "FitProgress") -> None:
        """Show the current iteration of the fit, and the best one so far."""
        self._check()
        judged = at.training_error if at.validation_error != at.validation_error else at.validation_error
        if at.stage != self._stage:
            self._stage, self._best = at.stage, (float("inf"), 0)
        self._best = min(self._best, (judged, at.iteration))
        stage = f"{at.stage}: " if at.stage else ""
        errors = f"training {_percent(at.training_error)}  "
        if at.validation_error == at.validation_error:
            errors += f"validation {_percent(at.validation_error)}  "
        line = (
            f"{stage}iteration {at.iteration:>3}/{at.iterations}  {errors}best at {self._best[1]}  {at.seconds:.1f} s"
        )
        if at.usual_s is not None:
            self._usual = f"a fit of this size usually takes {duration(at.usual_s[0])} to {duration(at.usual_s[1])}"
        if self._usual and say_beside(self._usual):
            self._usual = ""
        if self._terminal:
            self._status(line)
        elif at.iteration % self._EVERY == 0 or at.seconds - self._said_s >= self._LONGEST_S:
            self._said_s = at.seconds
            self._print(line)


def _percent(error: float) -> str:
    return "unbounded" if error == float("inf") else f"{number(error, '.4g', 100.0)} %"
