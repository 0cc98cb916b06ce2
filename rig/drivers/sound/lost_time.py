"""How many frames an audio system has lost, by a clock: frames are counted, and a clock tells how many there should be.

A call of the audio system is late by some jitter. After an interruption it may be late by periods, catch up and have lost
nothing, or frames are lost for good. The lead of the clock over the frames tells which, once it no longer falls.
"""

import numpy as np

from vibrolock.compiled import Record, kernel

CALLS_IN_DOUBT = 3
"""Calls after an interruption, or after the last one that caught up, until what was lost is told; chosen: the least lead of
three differs from the mean by less than the jitter."""
MEAN_OVER = 64.0
"""Calls over which the lead is averaged; chosen: a fifth of a second, in which clocks part by less than a frame."""
SMALLEST_LOSS = 8
"""Frames from which on a difference counts as lost; chosen: so far the mean lead varies."""

CLOCK = np.dtype(
    [(name, "f8") for name in ("rate_hz", "first_s", "mean_lead", "least_lead", "last_lead")]
    + [(name, "i8") for name in ("is_running", "in_doubt")]
)
"""What is known of the clock (one record). ``first_s``: its time at frame 0; ``mean_lead``: frames by which it leads the count,
averaged; ``least_lead``: the least since an interruption; ``last_lead``: that of the last call; ``in_doubt``: calls left until
what was lost is told."""
IN_DOUBT = -1
"""Returned where frames may be lost, and nobody knows yet."""


@kernel
def lost_frames(clock: Record, now_s: float, frame: int, frames: int, interrupted: bool) -> int:
    """Return how many frames were lost before a call that exchanges ``frames`` from ``frame`` on, or `IN_DOUBT`.

    ``now_s``: the clock at this call; ``interrupted``: whether the audio system says that it was interrupted before it.
    """
    if not clock.is_running:
        clock.is_running = 1
        clock.first_s = now_s - frame / clock.rate_hz
    lead = (now_s - clock.first_s) * clock.rate_hz - frame
    catches_up = clock.in_doubt > 0 and lead < clock.last_lead - frames / 4
    clock.last_lead = lead
    if interrupted or catches_up:
        clock.in_doubt, clock.least_lead = CALLS_IN_DOUBT, lead
    if clock.in_doubt == 0:
        clock.mean_lead += (lead - clock.mean_lead) / MEAN_OVER
        return 0
    clock.in_doubt -= 1
    clock.least_lead = min(clock.least_lead, lead)
    if clock.in_doubt > 0:
        return IN_DOUBT if lead - clock.mean_lead >= frames / 2 else 0
    lost: int = round(clock.least_lead - clock.mean_lead)
    return lost if lost >= SMALLEST_LOSS else 0
