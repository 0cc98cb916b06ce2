"""What a person sees on the terminal: progress of a run, tables, and quiet lines where there is no terminal."""

import contextlib
import json
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from rig.tick.tick import Tick

__all__ = ["RunProgress", "number", "print_json", "print_table"]

LOCK_WORDS = ("searching", "acquiring", "locked", "lost")


def print_json(value: Mapping[str, Any]) -> None:
    """One JSON document on standard output; numbers that do not exist are null."""
    print(json.dumps(_finite(value), indent=2))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def number(value: float | None, pattern: str, scale: float = 1.0) -> str:
    """A number in a format, or a dash where there is none."""
    return "-" if value is None or value != value else format(scale * value, pattern)


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table of right-aligned columns."""
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    for row in [headings, *rows]:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


POINT_LINE = (
    "point {number:>3}/{total}  {level:>7} {level_unit}  {force:>7} N  {frequency:>8} Hz  {damping:>6} %  "
    "{amplitude:>8} mm  phase error {phase:>6} deg  settled in {settle:>4} periods"
)


class RunProgress:
    """Writes a line for each point, and on a terminal a status line below that follows the loop."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._finished = 0

    def point(self, point: dict[str, Any], number_done: int, total: int) -> None:
        """Print the point's line."""
        self._finished = number_done
        if point["settled"] and "force_n" in point:
            line = POINT_LINE.format(
                number=number_done,
                total=total,
                level=f"{point['level']:.4g}",
                level_unit=point["level_unit"],
                force=number(point["force_n"], ".4f"),
                frequency=number(point["frequency_hz"], ".4f"),
                damping=number(point["damping_ratio"], ".4f", 100.0),
                amplitude=number(point["amplitude_m"], ".4f", 1e3),
                phase=number(point["phase_error_deg"], ".2f"),
                settle=number(point["settle_periods"], ".0f"),
            )
            line += "" if point["accepted"] else f"  NOT ACCEPTED: {point['reason']}"
        else:
            line = (
                f"point {number_done:>3}/{total}  {point['level']:.4g} {point['level_unit']}  FAILED: {point['reason']}"
            )
        self._print(line)

    def advance(self, rows: "np.ndarray", tick: "Tick") -> None:
        """Renew the status line."""
        if not self._terminal:
            return
        last = rows[-1]
        seconds = tick.sample / tick.bench.sample_rate_hz
        state = LOCK_WORDS[int(last["lock"])]
        self._status(
            f"\r\x1b[2K{seconds:8.1f} s  {float(last['frequency_hz']):9.4f} Hz  "
            f"{abs(complex(last['command_v'])):7.4f} V  {state}  {self._finished} points done"
        )

    def remark(self, text: str) -> None:
        """Print what the driver has to say about the bench."""
        self._print(f"note: {text}")

    def close(self) -> None:
        """Clear the status line."""
        if self._terminal:
            self._status("\r\x1b[2K")

    def _status(self, text: str) -> None:
        with contextlib.suppress(OSError):  # whoever read this has gone; the run goes on
            sys.stderr.write(text)
            sys.stderr.flush()

    def _print(self, line: str) -> None:
        self.close()
        with contextlib.suppress(OSError):
            print(line, file=sys.stderr, flush=True)
