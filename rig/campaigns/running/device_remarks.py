"""What the device says of the samples of a point: its flags, lost samples, and outputs that came too late."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from rig.campaigns.evaluation.device_faults import LOST, DeviceFaults
from rig.campaigns.evaluation.lost_samples import lost_rows, lost_warnings
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.rows import Rows, stretches
from rig.daq import CONTINUED, HELD, flag_names
from rig.text.disorder import disorder_text, is_late
from rig.tick.layout import DEVICE_SHIFT
from rig.tick.sequencer.repetition import LARGEST_CONTINUED, LARGEST_HELD


def with_device_remarks(point: Point[object], rows: Rows, counters: Iterable[str]) -> Point[object]:
    """Add to a point its samples that were lost or continued, and a warning for each other flag raised while it was recorded.

    ``counters`` are those of the driver. What reached the structure was measured, and judges the point. Besides, a point is not
    accepted if, because outputs came too late, the device held more than 5 % of them or went on by itself for more than 25 %:
    no measurement has shown that more does no harm. A point that was refused for another reason, and had outputs held, says
    that first.
    """
    names = flag_names(counters)
    counts, lost = dict.fromkeys(names, 0), 0
    for stretch in stretches(rows):
        flags = stretch["flags"] >> DEVICE_SHIFT
        for bit, name in enumerate(names if flags.any() else ()):
            counts[name] += int(np.count_nonzero(flags & (1 << bit)))
        lost += int(np.count_nonzero(lost_rows(stretch)))
    faults = DeviceFaults(counts.get(HELD, 0), counts.pop(CONTINUED, 0), lost, rows.size)
    said = [f"{name.replace('_', ' ')} in {count} of {rows.size} samples" for name, count in counts.items() if count]
    out = replace(point, lost_samples=lost, continued_samples=faults.continued)
    out = out.warned(*lost_warnings(lost, rows.size), *said)
    for count, largest in ((faults.held, LARGEST_HELD), (faults.continued, LARGEST_CONTINUED)):
        if count > largest * rows.size and point.accepted:
            return out.refused(f"{faults.text()}; allowed is up to {largest:.0%}")
    if faults.held and not point.accepted:
        return replace(out, reason=f"{faults.text()}; {point.reason}")
    return out


def with_disorder(point: Point[object], counters: Mapping[str, int]) -> Point[object]:
    """Name the order of frames where a point lacks samples and some came too late to be put in their place.

    ``counters`` are those of the driver, so far.
    """
    if not is_late(counters) or not (point.lost_samples or LOST in point.reason):
        return point
    text = disorder_text(counters)
    return point.warned(text) if point.accepted else replace(point, reason=f"{point.reason}; {text}")
