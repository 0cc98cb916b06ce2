"""Tables of the race in Markdown: what each method needs for the bounds, and all numbers with the usual knob."""

import math
import re
from pathlib import Path
from typing import Any

from studies.methods.choice import meets, together
from studies.methods.plans import METHODS, usual_knob
from studies.methods.race import Cell, Runs, cells
from studies.methods.rigs import CONDITIONS, RIGS

Row = dict[str, Any]
BEGIN, END = "<!-- race: begin -->", "<!-- race: end -->"


def needed(runs: Runs, cell: Cell) -> tuple[float, Row] | None:
    """Return the knob with the fewest periods whose runs all meet the bounds, and these together; None if there is none."""
    knobs = {row["knob"] for row in runs.rows if meets(row) and runs.cell_of(row) == cell}
    known = [(knob, runs.of(cell, knob)) for knob in sorted(knobs)]
    found = [(knob, together(rows)) for knob, rows in known if all(meets(row) for row in rows)]
    return min(found, key=lambda one: float(one[1]["periods"]), default=None)


def tables(runs: Runs) -> str:
    """Return all tables."""
    parts = [f"## Periods needed for 0.02 % and 2 %\n\nEntries: {' / '.join(CONDITIONS)}.\n", _overview(runs)]
    parts += [f"## {rig}\n\n{_all_numbers(runs, rig)}" for rig in RIGS]
    return "\n".join(parts)


def _overview(runs: Runs) -> str:
    """Return the cheapest test of each method on each rig, in periods: under noise, ten times the noise, and drift."""
    lines = [f"| method | {' | '.join(RIGS)} |", "|---" * (len(RIGS) + 1) + "|"]
    for method, what in METHODS.items():
        for pure in (False, True) if what.pure else (False,):
            name = f"{what.words}, sinusoidal force" if pure else what.words
            entries = []
            for rig in RIGS:
                found = [needed(runs, (rig, method, pure, condition)) for condition in CONDITIONS]
                entries.append(" / ".join("–" if one is None else f"{one[1]['periods']:.0f}" for one in found))
            lines.append(f"| {name} | {' | '.join(entries)} |")
    return "\n".join(lines) + "\n"


def _all_numbers(runs: Runs, rig: str) -> str:
    head = (
        "| method | force | condition | points | refused | s | periods | frequency, % | damping, % | covered, % | "
        "needed, periods | knob |"
    )
    lines = [head, "|---" * 12 + "|"]
    for cell in sorted(cells((rig,)), key=lambda one: (list(METHODS).index(one[1]), one[2])):
        _, method, pure, condition = cell
        known = runs.of(cell, usual_knob(method, rig))
        if known:
            words = (METHODS[method].words, "sinusoidal" if pure else "exciter's", condition)
            found = needed(runs, cell)
            least = "– | –" if found is None else f"{found[1]['periods']:.0f} | {found[0]:g}"
            lines.append(f"| {' | '.join(words)} | {_numbers(known)} | {least} |")
    return "\n".join(lines) + "\n"


def _numbers(known: list[Row]) -> str:
    if known[0]["asked_points"] == 0:
        return "plan refused | | | | | |"
    one = together(known)
    errors = (_errors(one[f"worst_{name}"], one[f"median_{name}"], digits) for name, digits in _DIGITS)
    covered = " / ".join(
        "–" if math.isnan(one[f"{name}_covered"]) else f"{100.0 * one[f'{name}_covered']:.0f}" for name, _ in _DIGITS
    )
    effort = f"{one['asked']} | {one['refused']:.0f} | {one['seconds']:.1f} | {one['periods']:.0f}"
    return f"{effort} | {' | '.join(errors)} | {covered}"


_DIGITS = (("frequency", 4), ("damping", 2))


def _errors(worst: float, median: float, digits: int) -> str:
    return "–" if math.isnan(worst) else f"{100.0 * worst:.{digits}f} / {100.0 * median:.{digits}f}"


def put(page: Path, text: str) -> None:
    """Put the tables into a page, between its two marks. Raises `ValueError` if the page does not have them."""
    old = page.read_text(encoding="utf-8")
    if BEGIN not in old or END not in old:
        raise ValueError(f"{page}: needs the lines {BEGIN} and {END}")
    new = re.sub(f"{BEGIN}.*{END}", lambda _: f"{BEGIN}\n\n{text}\n{END}", old, flags=re.DOTALL)
    page.write_text(new, encoding="utf-8")
