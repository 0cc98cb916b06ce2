"""Compiled repetition of records that were refused for something that passes: late outputs, lost samples, a disturbance."""

import math

import numpy as np

from rig.tick.sequencer.layout import RING, Outcome
from vibrolock.compiled import Record, kernel

LARGEST_HELD = 0.05  # of the samples of a record; measured to do no harm
LARGEST_CONTINUED = 0.25  # of the samples of a record; measured to do no harm
LARGEST_LOST = 0.05
"""Parts of a record's samples; with more, it is refused."""
MOST_ATTEMPTS = 6  # at a record, beyond the retries of the plan, while fewer of its samples are faulty each time


@kernel
def note_result(entry: Record, progress: Record, settling: Record, outcome: int) -> None:
    """Write how the present segment ended into an ``entry`` of the outcomes or of the refused records."""
    entry.outcome = outcome
    entry.end_sample = progress.sample
    entry.periods = progress.cycle - progress.start_cycle
    entry.mean_error_rad, entry.drift = settling.mean_error_rad, settling.drift
    entry.held, entry.continued, entry.lost = progress.held, progress.continued, progress.lost


@kernel
def too_many_faults(progress: Record, samples: float) -> int:
    """Return for which fault of the device a record that will have so many ``samples`` is certain to be refused, or DONE."""
    if progress.held > LARGEST_HELD * samples:
        return Outcome.OUTPUT_HELD
    if progress.continued > LARGEST_CONTINUED * samples:
        return Outcome.OUTPUT_CONTINUED
    if progress.lost > LARGEST_LOST * samples:
        return Outcome.SAMPLES_LOST
    return Outcome.DONE


@kernel
def step_is_over(progress: Record, over: bool) -> bool:
    """Return whether an output was held in this record, which is a step in the sine, and the device follows again."""
    return bool(progress.held > 0 and (over or progress.disturbed == 0))


@kernel
def may_try_again(progress: Record, is_certain: bool) -> bool:
    """Return whether a refused record may be measured again: up to the plan's retries.

    One with too many faults of the device (``is_certain``) may be tried more often while they become fewer.
    """
    if progress.tries_left > 0:
        return True
    gets_better = is_certain and progress.faulty_share < progress.faulty_before
    return bool(gets_better and 0 < progress.retries < progress.tries_left + MOST_ATTEMPTS - 1)


@kernel
def measure_again(
    progress: Record,
    segments: np.ndarray,
    outcomes: np.ndarray,
    settling: Record,
    outcome: int,
    is_certain: bool = False,
) -> bool:
    """Note a record that is refused for something that passes, and go back to where its point settles.

    ``is_certain``: it has too many faults of the device. Returns False, and does nothing, if the record may not be measured
    again.
    """
    segment = segments[progress.segment]
    faults = progress.held + progress.continued + progress.lost
    progress.faulty_share = faults / max(progress.sample - progress.start_sample, 1)
    if segment.again < 0 or not may_try_again(progress, is_certain):
        return False
    progress.faulty_before = progress.faulty_share
    entry = progress.refused[progress.n_refused % RING]
    entry.segment = progress.segment
    entry.first_sample = outcomes[progress.segment].first_sample
    note_result(entry, progress, settling, outcome)
    entry.force_n = settling.forces[(settling.count - 1) % settling.forces.size] if settling.count > 0 else math.nan
    progress.n_refused += 1
    progress.tries_left -= 1
    for index in range(segment.again, progress.segment + 1):
        outcomes[index].outcome = Outcome.PENDING
    progress.segment = segment.again
    progress.entered = 0
    return True
