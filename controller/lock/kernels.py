"""Compiled lock state: advanced once a period."""

from controller.layout import ACQUIRING, LOCKED, LOST, SEARCHING
from vibrolock.compiled import Record, kernel


@kernel
def next_lock_state(lock: Record, thresholds: Record, present: bool, held: bool, error: float) -> None:
    """Advance the lock state by one oscillator period, from the period's mean phase error (rad).

    ``present``: force and response stand above the smallest amplitudes that a phase can be read from.
    ``held``: the level is not being ramped; only then is a large error counted towards a lost lock.
    """
    size = abs(error)
    if not present:
        lock.close_periods = 0
        if lock.state == LOCKED:
            lock.far_periods += 1
            if lock.far_periods >= thresholds.lost_periods:
                lock.state = LOST
        elif lock.state != LOST:
            lock.state = SEARCHING
        return
    if lock.state == SEARCHING:
        lock.state = ACQUIRING
    lock.close_periods = lock.close_periods + 1 if size < thresholds.locked_rad else 0
    if size > thresholds.lost_rad and held:
        lock.far_periods += 1
    elif size > thresholds.lost_rad and lock.state == LOCKED:
        lock.state = ACQUIRING
    else:
        lock.far_periods = 0
    if lock.close_periods >= thresholds.locked_periods:
        lock.state = LOCKED
        lock.far_periods = 0
    elif lock.state == LOCKED and lock.far_periods >= thresholds.lost_periods:
        lock.state = LOST


@kernel
def reacquire(lock: Record) -> None:
    """A new level is being approached: a lost lock may be sought again."""
    lock.far_periods = 0
    lock.close_periods = 0
    lock.state = ACQUIRING
