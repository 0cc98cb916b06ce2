"""Warnings of the device about the samples of a point: its flags, lost samples, and outputs that came too late."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from rig.campaigns.evaluation.device_faults import faults_text
from rig.campaigns.evaluation.lost_samples import lost_rows, lost_warnings
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.rows import Rows, stretches
from rig.daq import HELD, flag_names
from rig.tick.layout import DEVICE_SHIFT

__all__ = ["with_device_remarks"]

LARGEST_HELD = 0.05  # of a point's samples: above this, the recorded voltage is not the voltage that was put out


def with_device_remarks(point: Point[Any], rows: Rows, counters: Iterable[str]) -> Point[Any]:
    """Add to a point the number of its lost samples, and a warning for each flag raised while it was recorded.

    ``counters`` are those of the driver. A point is not accepted if the device held more than 5 % of its outputs because they
    came too late. A point that was refused for another reason, and had outputs held, says that first.
    """
    names = flag_names(counters)
    counts, lost = dict.fromkeys(names, 0), 0
    for stretch in stretches(rows):
        flags = stretch["flags"] >> DEVICE_SHIFT
        for bit, name in enumerate(names if flags.any() else ()):
            counts[name] += int(np.count_nonzero(flags & (1 << bit)))
        lost += int(np.count_nonzero(lost_rows(stretch)))
    said = {
        name: f"{name.replace('_', ' ')} in {count} of {rows.size} samples" for name, count in counts.items() if count
    }
    out = replace(point, lost_samples=lost).warned(*lost_warnings(lost, rows.size), *said.values())
    held = counts.get(HELD, 0)
    if held > LARGEST_HELD * rows.size and point.accepted:
        return out.refused(f"{faults_text(held, 0, rows.size)}; allowed is {LARGEST_HELD:.0%}")
    if held and not point.accepted:
        return replace(out, reason=f"{faults_text(held, 0, rows.size)}; {point.reason}")
    return out
