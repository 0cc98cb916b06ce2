"""Codes and records of the sequencer.

A plan compiles to a table of segments. Durations are in periods of the oscillator, counted at the inputs.
"""

from enum import IntEnum

from controller.harmonics import ORDERS
from vibrolock.arrays import record


class SegmentKind(IntEnum):
    """Action of a segment on level or frequency."""

    RAMP = 0
    """Half-cosine from the present level to ``level`` in ``periods``."""
    SETTLE = 1
    """Hold until settled, for at most ``periods``."""
    RECORD = 2
    """Hold for ``periods`` under the settle rule; these rows are evaluated."""
    HOLD = 3
    """Hold for ``periods`` without applying the settle rule."""
    SWEEP = 4
    """Hold the level and sweep the frequency of a tone to ``omega``; these rows are evaluated."""
    LEVEL_SWEEP = 5
    """A ramp of the level whose rows are evaluated."""
    START = 6
    """Hold for ``periods``, and longer while a lock is in doubt. If the start fails, the run ends before the level rises."""
    RELEASE = 7
    """0 V at once for ``periods`` of the frozen frequency, while the vibration decays; these rows are evaluated."""


EVALUATED = {SegmentKind.RECORD, SegmentKind.SWEEP, SegmentKind.LEVEL_SWEEP, SegmentKind.RELEASE}
"""Segments whose rows are evaluated."""


class Drive(IntEnum):
    """Source of the output's frequency."""

    LOOP = 0
    """The phase-locked loop."""
    TONE = 1
    """The plan: one frequency, ramped, stepped or swept."""
    WAVEFORM = 2
    """The plan: a periodic waveform of unit peak is played. The level is its peak; its period is the oscillator period."""
    SILENT = 3
    """Nothing: the output is 0 V and the oscillator runs on at its last frequency."""


class Outcome(IntEnum):
    """Result of a segment."""

    PENDING = 0
    RUNNING = 1
    DONE = 2
    NOT_SETTLED = 3
    """The time for settling ran out."""
    DISTURBED = 4
    """The settle rule was broken while recording."""
    LOST_LOCK = 5
    UNREACHABLE = 6
    """The output was at its voltage limit and the level was not reached."""
    SKIPPED = 7
    INTERRUPTED = 8
    OUTSIDE_WINDOW = 9
    """The loop's frequency was at an end of its window."""
    NOT_LOCKED = 10
    """The phase error was that of a lost lock during the whole time at the start voltage."""
    OUTPUT_HELD = 11
    """The device held outputs that came too late."""
    SAMPLES_LOST = 12
    """Too many samples were lost in transmission."""
    OUTPUT_CONTINUED = 13
    """The device went on by itself for too many samples, because outputs came too late."""
    TOO_STEEP = 14
    """On the way to its level the backbone became steeper than the gains bear."""
    NEAR_LIMIT = 15
    """On the way to its level force or motion came near a limit."""


class OnFailure(IntEnum):
    """Action after a failed point: skip the point or stop the plan."""

    SKIP = 0
    STOP = 1


SEGMENT = record(
    ("harmonics", "c16", ORDERS),
    i8="kind point amplitude_law geometric samples on_failure on_lost_lock drive logarithmic waveform again",
    f8="level lag_rad periods omega rate",
)
"""One segment of a plan, ``periods`` long, or ``samples`` where these are not 0.

``level``: in the unit of the amplitude law (V, N, m); ``geometric``: ramped by the logarithm. ``lag_rad``: wanted phase lag.
``omega``: final frequency of a tone (rad/s). ``rate``: of a sweep, in rad/s per sample, or in 1 per sample if ``logarithmic``.
``waveform``: number of the waveform that is played. ``again``: of a record, the number of the segment with which its
repetition begins; else -1. ``harmonics``: those that the harmonics loop makes, as ratios to the fundamental."""

OUTCOME = record(
    i8="outcome first_sample end_sample held continued lost left_alone", f8="periods mean_error_rad drift distortion"
)
"""Result of each segment: samples [first, end), periods used, last averaged phase error, last relative amplitude drift, number
of samples with a held output, with a continued one, and of lost ones. ``distortion``: last error of the controlled harmonics
over its tolerance; ``left_alone``: bit h for each harmonic h that the harmonics loop leaves alone."""

REFUSED = record(
    i8="segment outcome first_sample end_sample held continued lost", f8="periods mean_error_rad drift force_n"
)
"""A record that was refused and is measured again: what `OUTCOME` says of it, and the force's fundamental, N."""

RING = 64
"""Refused records that are kept for the campaign, which reads them every few hundredths of a second."""

PROGRESS = record(
    ("refused", REFUSED, (RING,)),
    i8="segment segments sample unreached returning held_back start_sample finished entered unlocked point "
    "tries_left retries held continued lost disturbed n_refused",
    f8="cycle start_cycle last_cycle frozen_cycles waited_cycles slowed_cycles kept_level start_level level start_lag lag "
    "start_omega omega faulty_share faulty_before",
)
"""Position of the run in the plan (one record). ``cycle``: oscillator periods at the inputs so far, with the fraction;
``unreached``: the output is at its limit and the present level is not reached; ``frozen_cycles``: periods for which a ramp
waited because its level was not reached; ``waited_cycles``: those for which it waited for the phase; ``slowed_cycles``: those
by which a steep backbone made it longer; ``unlocked``: no lock was ever gained. ``kept_level``: the last held level with a
lock; ``held_back``: the start segment does not end before the campaign has judged it; ``returning``: the level goes back there
because the lock was lost.

``retries``: how often a record is measured again at most; ``point``, ``tries_left``: how often the record of the present point
still may be. ``held``, ``continued``, ``lost``: samples of the present segment with a held output, with a continued one, and
lost ones; ``disturbed``: whether this sample is one of them; ``faulty_share``, ``faulty_before``: part of the samples that were
such in the present record, and in the refused one before. ``refused``: a ring of the records that were refused so far,
``n_refused`` in all."""
