"""How many frames an audio system has lost, by a clock: frames are counted, and a clock tells how many there should be.

A call of the audio system is late by some jitter, and after an interruption it may be late by periods, catch up and have lost
nothing; or frames are lost for good. The least lead of the clock over the frames within a window tells which.
"""

import numpy as np

from vibrolock.compiled import Record, kernel

WINDOW_S = 0.02
"""Length of a window, s; chosen: several periods, within which a late callback has caught up."""
SMALLEST_LOSS = 8
"""Frames from which on a difference counts as lost; chosen: so far the least lateness of a window varies."""
WINDOWS_IN_DOUBT = 2
"""Windows after an interruption in which frames may be found lost: another one may have come within the first."""

CLOCK = np.dtype(
    [(name, "f8") for name in ("rate_hz", "first_s", "lead", "least_lead")]
    + [(name, "i8") for name in ("is_running", "window_left", "in_doubt")]
)
"""What is known of the clock (one record). ``first_s``: its time at frame 0; ``lead``: frames by which it leads the count, the
least of the last window, and ``least_lead`` of this one; ``window_left``: calls left of this window; ``in_doubt``: windows left
in which frames may be found lost."""
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
    if clock.window_left == 0 or (interrupted and clock.in_doubt == 0):
        clock.least_lead = lead
        clock.window_left = max(2, round(WINDOW_S * clock.rate_hz / frames))
    if interrupted:
        clock.in_doubt = WINDOWS_IN_DOUBT
    clock.least_lead = min(clock.least_lead, lead)
    clock.window_left -= 1
    if clock.window_left > 0:
        return IN_DOUBT if clock.in_doubt > 0 and lead - clock.lead >= frames / 2 else 0
    lost: int = round(clock.least_lead - clock.lead)
    clock.lead = clock.least_lead
    if clock.in_doubt == 0:
        return 0
    clock.in_doubt -= 1
    if lost < SMALLEST_LOSS:
        return 0
    clock.lead -= lost
    return lost
