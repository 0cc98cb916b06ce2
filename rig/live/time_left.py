"""How long a plan will still take, as far as that can be known."""

import math

import numpy as np

from rig.tick.layout import TickArrays
from rig.tick.sequencer.layout import Drive, Outcome, SegmentKind

NO_SETTLING_YET = 3.0  # times the settled periods that the rule asks for at least


def time_left_s(t: TickArrays) -> float:
    """Return an estimate of the time until the last segment is over, s.

    A settling counts as long as the mean of those so far, and periods as long as at the present frequency where the loop sets
    it. Points that are measured again, failed ones that are skipped and ramps that wait are not foreseen.
    """
    progress, segments, outcomes = t.progress[0], t.segments, t.outcomes
    present = int(progress["segment"])
    if present >= segments.size:
        return 0.0
    dt_s, omega = float(t.loop["dt_s"][0]), float(t.control["frequency"]["omega"][0])
    left = segments[present:]
    periods = left["periods"].copy()
    settles = left["kind"] == SegmentKind.SETTLE
    settled = outcomes["periods"][
        (segments["kind"] == SegmentKind.SETTLE) & (outcomes["outcome"] == Outcome.DONE) & (outcomes["periods"] > 0.0)
    ]
    usual = float(settled.mean()) if settled.size else NO_SETTLING_YET * float(t.rule["settled_periods"][0])
    periods[settles] = np.minimum(periods[settles], usual)
    of_plan = (left["drive"] == Drive.TONE) & (left["omega"] > 0.0)
    seconds = periods * 2.0 * math.pi / np.where(of_plan, left["omega"], omega)
    counted = left["samples"] > 0
    seconds[counted] = left["samples"][counted] * dt_s
    for index in np.flatnonzero(left["kind"] == SegmentKind.SWEEP):
        before = float(left["omega"][index - 1]) if index > 0 else float(progress["start_omega"])
        end, rate = float(left["omega"][index]), float(left["rate"][index])
        way = math.log(end / before) if left["logarithmic"][index] and before > 0.0 else end - before
        seconds[index] = max(way / rate, 0.0) * dt_s if rate else 0.0
    done_s = (int(progress["sample"]) - int(progress["start_sample"])) * dt_s if progress["entered"] else 0.0
    return float(max(seconds[0] - done_s, 0.0) + seconds[1:].sum())
