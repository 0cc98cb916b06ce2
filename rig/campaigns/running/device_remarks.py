"""Warnings of the device about the samples of a point: its flags, lost samples, and outputs that came too late."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from rig.campaigns.evaluation.lost_samples import lost_rows, lost_warnings
from rig.campaigns.evaluation.point import Point
from rig.daq import LOST
from rig.tick.layout import DEVICE_SHIFT

__all__ = ["flag_names", "with_device_remarks"]

HELD = "output_held"
LARGEST_HELD = 0.05  # of a point's samples: the rows tell another voltage than was put out


def flag_names(counters: Iterable[str]) -> list[str]:
    """Names of the device's flags, the lowest bit first: the driver's first counters, as far as there are bits below `LOST`."""
    return [*counters][: LOST.bit_length() - 1]


def with_device_remarks(point: Point[Any], rows: np.ndarray, counters: Iterable[str]) -> Point[Any]:
    """A point with the number of its samples that were lost, and a warning for each flag that was up while it was recorded.

    ``counters`` are the driver's. A point with more than 5 % of its outputs held by the device, because they came too late,
    is not accepted.
    """
    flags = rows["flags"] >> DEVICE_SHIFT
    counts = {name: int(np.count_nonzero(flags & (1 << bit))) for bit, name in enumerate(flag_names(counters))}
    said = {
        name: f"{name.replace('_', ' ')} in {count} of {rows.size} samples" for name, count in counts.items() if count
    }
    out = replace(point, lost_samples=int(np.count_nonzero(lost_rows(rows))))
    out = out.warned(*lost_warnings(rows), *said.values())
    if counts.get(HELD, 0) > LARGEST_HELD * rows.size and point.accepted:
        return out.refused(f"outputs came too late: {said[HELD]}, allowed is {LARGEST_HELD:.0%}")
    return out
