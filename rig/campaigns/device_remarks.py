"""What the device says of the samples of a point: its flags, samples that were lost, and outputs that came too late."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from rig.campaigns.gaps import lost_rows, lost_warnings
from rig.tick.layout import DEVICE_SHIFT

__all__ = ["with_device_remarks"]

HELD = "output_held"
LARGEST_HELD = 0.05  # of a point's samples: the rows tell another voltage than was put out


def with_device_remarks(point: Mapping[str, Any], rows: np.ndarray, counters: Iterable[str]) -> dict[str, Any]:
    """A point with the number of its samples that were lost, and a warning for each flag that was up while it was recorded.

    ``counters`` name the flags' bits, lowest first. A point with more than 5 % of its outputs held by the device, because they
    came too late, is not accepted.
    """
    flags = rows["flags"] >> DEVICE_SHIFT
    counts = {name: int(np.count_nonzero(flags & (1 << bit))) for bit, name in enumerate(counters)}
    said = {
        name: f"{name.replace('_', ' ')} in {count} of {rows.size} samples" for name, count in counts.items() if count
    }
    warnings = [*point.get("warnings", []), *lost_warnings(rows), *said.values()]
    out = {**point, "lost_samples": int(np.count_nonzero(lost_rows(rows))), "warnings": warnings}
    if counts.get(HELD, 0) > LARGEST_HELD * rows.size and point["accepted"]:
        out |= {"accepted": False, "reason": f"outputs came too late: {said[HELD]}, allowed is {LARGEST_HELD:.0%}"}
    return out
