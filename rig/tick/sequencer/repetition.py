"""Compiled repetition of records that were refused for something that passes: held outputs, lost samples, a disturbance."""

import math

import numpy as np

from rig.tick.sequencer.layout import RING, Outcome
from vibrolock.compiled import Record, kernel

__all__ = ["measure_again", "passing_fault"]

PENDING = int(Outcome.PENDING)
DONE = int(Outcome.DONE)
OUTPUT_HELD = int(Outcome.OUTPUT_HELD)
SAMPLES_LOST = int(Outcome.SAMPLES_LOST)
LARGEST_LOST = 0.05  # of a record's samples; with more lost, its evaluation refuses it


@kernel
def passing_fault(progress: Record, samples: int, over: bool) -> int:
    """Return why the present record is refused for a passing fault of the device, or DONE.

    A held output refuses it as soon as the device follows its outputs again, lost samples at its end if they are too many.
    """
    if progress.held > 0 and (over or progress.disturbed == 0):
        return OUTPUT_HELD
    if over and progress.lost > LARGEST_LOST * samples:
        return SAMPLES_LOST
    return DONE


@kernel
def measure_again(progress: Record, segments: np.ndarray, outcomes: np.ndarray, settling: Record, outcome: int) -> bool:
    """Note a record that is refused for something that passes, and go back to where its point settles.

    Returns False, and does nothing, if the record may not be measured again.
    """
    segment = segments[progress.segment]
    if segment.again < 0 or progress.tries_left < 1:
        return False
    entry = progress.refused[progress.n_refused % RING]
    entry.segment = progress.segment
    entry.outcome = outcome
    entry.first_sample = outcomes[progress.segment].first_sample
    entry.end_sample = progress.sample
    entry.periods = progress.cycle - progress.start_cycle
    entry.mean_error_rad = settling.mean_error_rad
    entry.drift = settling.drift
    entry.held = progress.held
    entry.continued = progress.continued
    entry.lost = progress.lost
    entry.force_n = settling.forces[(settling.count - 1) % settling.forces.size] if settling.count > 0 else math.nan
    progress.n_refused += 1
    progress.tries_left -= 1
    for index in range(segment.again, progress.segment + 1):
        outcomes[index].outcome = PENDING
    progress.segment = segment.again
    progress.entered = 0
    return True
