"""Codes and records of the sequencer.

A plan compiles to a table of segments. Durations count periods of the oscillator as seen by the inputs.
"""

from enum import IntEnum

import numpy as np

__all__ = ["OUTCOME", "PROGRESS", "SEGMENT", "Drive", "OnFailure", "Outcome", "SegmentKind"]


class SegmentKind(IntEnum):
    """What a segment does with the level."""

    RAMP = 0
    """Half-cosine from the present level to ``level`` in ``periods``."""
    SETTLE = 1
    """Hold until settled, at the most ``periods``."""
    RECORD = 2
    """Hold for ``periods``, watched all the time; these rows are evaluated."""
    HOLD = 3
    """Hold for ``periods``, watched by nobody."""
    SWEEP = 4
    """Hold the level and sweep the frequency of a tone to ``omega``; these rows are evaluated."""
    LEVEL_SWEEP = 5
    """A ramp of the level whose rows are evaluated."""
    START = 6
    """Hold for ``periods``, and as long as a lock is in doubt; without any the run ends before a loop takes the level over."""


class Drive(IntEnum):
    """Where the output's frequency comes from."""

    LOOP = 0
    """The phase-locked loop."""
    TONE = 1
    """The plan: one frequency, ramped, stepped or swept."""
    WAVEFORM = 2
    """The plan: a periodic waveform of unit peak is played; the level is its peak, one oscillator period its period."""


class Outcome(IntEnum):
    """How a segment ended."""

    PENDING = 0
    RUNNING = 1
    DONE = 2
    NOT_SETTLED = 3
    """The time to settle ran out."""
    DISTURBED = 4
    """The settle rule was broken while recording."""
    LOST_LOCK = 5
    UNREACHABLE = 6
    """The output stood at its voltage limit and the level was not reached."""
    SKIPPED = 7
    INTERRUPTED = 8
    OUTSIDE_WINDOW = 9
    """The loop's frequency stood at an end of its window."""
    NOT_LOCKED = 10
    """The phase error stayed beyond that of a lost lock for all the time at the start voltage."""


class OnFailure(IntEnum):
    """What a failed point does to the rest of the plan."""

    SKIP = 0
    STOP = 1


RAMP, SETTLE, RECORD, HOLD, SWEEP, LEVEL_SWEEP, START = (int(kind) for kind in SegmentKind)
LOOP_DRIVE, TONE, WAVEFORM = (int(drive) for drive in Drive)

SEGMENT = np.dtype(
    [
        ("kind", "i8"),
        ("point", "i8"),
        ("level", "f8"),
        ("amplitude_law", "i8"),
        ("geometric", "i8"),
        ("lag_rad", "f8"),
        ("periods", "f8"),
        ("samples", "i8"),
        ("on_failure", "i8"),
        ("on_lost_lock", "i8"),
        ("drive", "i8"),
        ("omega", "f8"),
        ("rate", "f8"),
        ("logarithmic", "i8"),
        ("waveform", "i8"),
    ]
)
"""One segment of a plan, ``periods`` long, or ``samples`` where these are not 0.

``level`` in the unit of its amplitude law (V, N, m), where ``geometric`` ramped by its logarithm, ``lag_rad`` the wanted phase
lag, ``omega`` (rad/s) that a tone ends with, ``rate`` of a sweep in rad/s per sample, of a logarithmic one in 1 per sample,
``waveform`` the number of the one that is played."""

OUTCOME = np.dtype(
    [
        ("outcome", "i8"),
        ("first_sample", "i8"),
        ("end_sample", "i8"),
        ("periods", "f8"),
        ("mean_error_rad", "f8"),
        ("drift", "f8"),
    ]
)
"""How each segment went: samples [first, end), periods used, last averaged phase error, last relative amplitude drift."""

PROGRESS = np.dtype(
    [
        ("segment", "i8"),
        ("segments", "i8"),
        ("cycle", "f8"),
        ("sample", "i8"),
        ("unreached", "i8"),
        ("start_cycle", "f8"),
        ("last_cycle", "f8"),
        ("frozen_cycles", "f8"),
        ("start_sample", "i8"),
        ("start_level", "f8"),
        ("level", "f8"),
        ("start_lag", "f8"),
        ("lag", "f8"),
        ("start_omega", "f8"),
        ("omega", "f8"),
        ("finished", "i8"),
        ("entered", "i8"),
        ("unlocked", "i8"),
    ]
)
"""Where in the plan the run stands (one record). ``cycle``: oscillator periods that the inputs have seen so far, with the
fraction; ``unreached``: the output stands at its limit and the level of the moment is not reached; ``frozen_cycles`` of a ramp
that its level could not follow; ``unlocked``: no lock was ever gained."""
