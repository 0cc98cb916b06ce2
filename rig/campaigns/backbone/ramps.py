"""Phase errors in the ramps from level to level of a recorded backbone."""

import math
from typing import NamedTuple

import numpy as np

from rig.campaigns.backbone.plan import BackbonePlan
from rig.recording.parts import Part
from rig.tick.sequencer.layout import SegmentKind


class Ramp(NamedTuple):
    """The ramp from one point to the next, as it was carried out."""

    start: float
    """Level of the point before, in the plan's unit."""
    end: float
    """Level of the point."""
    planned: float
    """Its length in the plan, over `BackbonePlan.ramp_periods`."""
    taken: float
    """Its length as it was carried out, over the same: it is slower, or waits, while the phase lags."""
    error_deg: float
    """Largest mean phase error of a period in it, deg."""
    noise_deg: float
    """Standard deviation of the mean phase error of a period in the records of the two points, deg; the larger one."""


def ramps_in(part: Part, plan: BackbonePlan, sample_rate_hz: float) -> tuple[Ramp, ...]:
    """Return the ramps that the first part of a run holds, in their order; without the one to the first point."""
    segment, theta = part.rows("segment"), part.rows("theta_rad")
    if not segment.size:
        return ()
    error = np.degrees(np.nan_to_num(part.rows("phase_error_rad")))
    starts = np.flatnonzero(np.append(True, np.diff(theta) < -math.pi))
    mean = np.add.reduceat(error, starts) / np.diff(np.append(starts, error.size))
    where = segment[starts]
    out: list[Ramp] = []
    before = noise = math.nan
    for k, each in enumerate(plan.segments(sample_rate_hz)):
        errors = mean[where == k]
        if each.point < 0 or not errors.size:
            continue
        if each.kind is SegmentKind.RECORD:
            before, noise = each.level, float(np.std(errors))
            if out and out[-1].end == each.level:
                out[-1] = out[-1]._replace(noise_deg=float(np.fmax(noise, out[-1].noise_deg)))
        elif each.kind is SegmentKind.RAMP and each.point > 0:
            planned, took = each.periods / plan.ramp_periods, errors.size / plan.ramp_periods
            out.append(Ramp(before, each.level, planned, took, float(np.abs(errors).max()), noise))
    return tuple(out)
