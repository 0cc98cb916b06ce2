"""The cheapest value of a method's knob with which it meets the bounds, and the numbers of several runs together."""

import math
import statistics
from collections.abc import Callable, Sequence
from typing import Any

FREQUENCY_WITHIN, DAMPING_WITHIN = 2e-4, 0.02
"""Bounds of the errors of a backbone: of every level, relative."""
FACTORS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Values of a knob that are tried, over the usual one."""

Row = dict[str, Any]


def meets(row: Row) -> bool:
    """Return whether a run has all levels within the bounds."""
    frequency, damping = row["frequency_errors"], row["damping_errors"]
    whole = len(frequency) == row["levels"] and not row["failed"]
    return whole and _largest(frequency) <= FREQUENCY_WITHIN and _largest(damping) <= DAMPING_WITHIN


def _largest(errors: Sequence[float]) -> float:
    """Return the largest error, infinite where one is not a number."""
    return max((abs(error) if math.isfinite(error) else math.inf for error in errors), default=math.inf)


def cheapest(usual: float, suffices: Callable[[float], bool], largest: float = math.inf) -> float:
    """Return the smallest knob that suffices, of those from half to eight times the usual one; NaN if none does.

    From the usual one the knob is halved while it suffices, or doubled until it does, up to ``largest``.
    """
    found, middle = math.nan, FACTORS.index(1.0)
    if suffices(usual):
        found = usual
        for factor in FACTORS[:middle][::-1]:
            if not suffices(factor * usual):
                break
            found = factor * usual
        return found
    for factor in FACTORS[middle + 1 :]:
        if factor * usual > largest:
            break
        if suffices(factor * usual):
            return factor * usual
    return found


def together(rows: Sequence[Row]) -> Row:
    """Return what several runs with the same knob come to: medians of the effort, worst and median errors, coverage."""
    frequency, damping = ([abs(e) for row in rows for e in row[key]] for key in ("frequency_errors", "damping_errors"))
    return {
        "runs": len(rows),
        "met": sum(meets(row) for row in rows),
        "asked": rows[0]["asked_points"],
        "refused": statistics.median(row["refused"] for row in rows),
        "measured": statistics.median(len(row["frequency_errors"]) for row in rows),
        "seconds": statistics.median(row["seconds"] for row in rows),
        "periods": statistics.median(row["periods"] for row in rows),
        "worst_frequency": max(frequency, default=math.nan),
        "median_frequency": statistics.median(frequency) if frequency else math.nan,
        "worst_damping": max(damping, default=math.nan),
        "median_damping": statistics.median(damping) if damping else math.nan,
        "frequency_covered": _share([x for row in rows for x in row["frequency_covered"]]),
        "damping_covered": _share([x for row in rows for x in row["damping_covered"]]),
    }


def _share(held: Sequence[bool]) -> float:
    return sum(held) / len(held) if held else math.nan
