"""The phase lock: decides when a lock counts as gained and as lost."""

import math
from enum import IntEnum
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel
from vibrolock.errors import InputError


class LockState(IntEnum):
    """State of the phase lock."""

    SEARCHING = 0
    """Force or response is too small for its phase to be read; the frequency is held."""
    ACQUIRING = 1
    """The loop is closed and not yet close to the wanted phase."""
    LOCKED = 2
    """The phase error has stayed small for several periods."""
    LOST = 3
    """A lock was lost: the error has been large for several periods while the level was held. This is a fault."""


SEARCHING, ACQUIRING, LOCKED, LOST = (int(state) for state in LockState)

MOST_SLOWING, FORETOLD_SLOWING = 0.95, 0.8
"""Part of its rate that a ramp loses on the steepest backbone, and on one that is foretold to be so; chosen: it still gets
there, and takes not much longer where a stop makes the backbone steep at once and then no more."""
MOST_LAG_SLOWING = 0.85  # part of its rate that a ramp loses by the lag that it has had; chosen: seven times as long
STEEP_PERIODS = 3  # in a row: one disturbed period ends no ramp; chosen: beyond a fold a vibration jumps within ten
SWINGING = 3  # times as many far periods, less close ones, lose a lock whose phase swings to and fro

THRESHOLDS = record(
    i8="locked_periods lost_periods", f8="locked_rad lost_rad waiting_rad smallest_force_n smallest_response"
)
"""Thresholds at which a lock is gained and lost (one record)."""

LOCK = record(
    i8="state in_band_periods out_of_band_periods net_out_of_band_periods gained side swings steep_periods",
    f8="slowing steep_slowing lag_slowing begun_slowing largest_lag",
)
"""State of the phase lock (one record). ``in_band_periods``, ``out_of_band_periods``: in a row, up to the present one;
``net_out_of_band_periods``: periods out of the band less those in it, at a held level; ``gained``: there has been a lock
before; ``side``: sign of the last error out of the band, and ``swings``: how often it has changed, in a ramp that waits, since
the last lock; ``slowing``: by how much of its rate, 0 to 1, the error of the present period makes an upward ramp slower;
``steep_slowing``: the same by the slope of the backbone, and ``lag_slowing`` by ``largest_lag``, the largest error in this ramp
over the one from which it is slower; ``begun_slowing``: ``lag_slowing`` where this ramp began, by the lag in the one before;
``steep_periods``: in a row, in a ramp up on a backbone steeper than the gains bear."""


class LockRule(Settings):
    """When a phase lock counts as gained and as lost."""

    locked_deg: float = Field(5.0, gt=0, le=45)
    """Mean phase error of a period below which the period counts as close, deg."""
    locked_periods: int = Field(10, ge=1, le=1000)
    """Close periods in a row that make a lock."""
    lost_deg: float = Field(30.0, gt=0, le=180)
    """Mean phase error of a period above which the period counts as far, deg."""
    lost_periods: int = Field(20, ge=1, le=1000)
    """Far periods in a row, at a held level, that lose a lock; or three times as many, less the close ones between them; or, in
    a ramp that waits, as many swings from far on one side to far on the other."""
    waiting_deg: float = Field(30.0, gt=0, le=180)
    """Mean phase error of a period above which an upward ramp of the level waits, once there has been a lock, deg. From half of
    it on the ramp is slower: its rate falls in proportion, to nothing at this error."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.lost_deg <= self.locked_deg:
            raise InputError(field="lost_deg", value=self.lost_deg, allowed=f"above `locked_deg` = {self.locked_deg:g}")
        return self

    def build(self, smallest_force_n: float = 0.0, smallest_response: float = 0.0) -> np.ndarray:
        """Return one record of `THRESHOLDS`; the bench's sensors give the smallest amplitudes (N and the response's unit)."""
        out = np.zeros(1, THRESHOLDS)
        out["locked_rad"] = math.radians(self.locked_deg)
        out["locked_periods"] = self.locked_periods
        out["lost_rad"] = math.radians(self.lost_deg)
        out["lost_periods"] = self.lost_periods
        out["waiting_rad"] = math.radians(self.waiting_deg)
        out["smallest_force_n"] = smallest_force_n
        out["smallest_response"] = smallest_response
        return out


@kernel
def next_lock_state(
    lock: Record, thresholds: Record, present: bool, held: bool, error: float, waits: bool = False
) -> None:
    """Advance the lock state by one oscillator period, given the period's mean phase error (rad).

    ``present``: force and response exceed the smallest amplitudes whose phase can be read.
    ``held``: the level is not being ramped; only then does a large error count towards a lost lock. A phase that swings through
    zero and is far most of the time is lost too, after three times as many periods, for a knock makes it swing as well; also
    where a ramp has shaken the lock off before. In a ramp that ``waits`` for the phase a lag is no loss, but a phase that has
    swung from far on one side to far on the other as often as there are periods to lose a lock.
    """
    size = abs(error)
    if not present:
        lock.in_band_periods = 0
        lock.slowing = 0.0
        if lock.state == LOCKED:
            lock.out_of_band_periods += 1
            if lock.out_of_band_periods >= thresholds.lost_periods:
                lock.state = LOST
        elif lock.state != LOST:
            lock.state = SEARCHING
        return
    if lock.state == SEARCHING:
        lock.state = ACQUIRING
    lock.in_band_periods = lock.in_band_periods + 1 if size < thresholds.locked_rad else 0
    lag = 2.0 * size / thresholds.waiting_rad
    lock.slowing = min(max(lag - 1.0, 0.0), 1.0)
    if waits:
        lock.largest_lag = max(lock.largest_lag, lag)
        lock.lag_slowing = max(lock.begun_slowing, slowing_for_lag(lock))
    if waits and size > thresholds.lost_rad:
        side = 1 if error > 0.0 else -1
        lock.swings += 1 if lock.side == -side else 0
        lock.side = side
    if not held:
        lock.net_out_of_band_periods = 0
    elif size > thresholds.lost_rad:
        lock.net_out_of_band_periods += 1
    elif size < thresholds.locked_rad and lock.net_out_of_band_periods > 0:
        lock.net_out_of_band_periods -= 1
    if size > thresholds.lost_rad and held:
        lock.out_of_band_periods += 1
    elif size > thresholds.lost_rad and lock.state == LOCKED:
        lock.state = ACQUIRING
    else:
        lock.out_of_band_periods = 0
    if lock.in_band_periods >= thresholds.locked_periods:
        lock.state = LOCKED
        lock.gained = 1
        lock.out_of_band_periods = 0
        lock.net_out_of_band_periods = 0
        lock.side = lock.swings = 0
        return
    gone = lock.state == LOCKED and lock.out_of_band_periods >= thresholds.lost_periods
    gone = gone or lock.swings >= thresholds.lost_periods
    if gone or (lock.gained == 1 and lock.net_out_of_band_periods >= SWINGING * thresholds.lost_periods):
        lock.state = LOST


@kernel
def mind_steepness(lock: Record, here: float, ahead: float) -> None:
    """Slow an upward ramp from half of the steepest backbone that the gains bear, and give it up beyond that.

    ``here``, ``ahead``: slope of the backbone at the present level, and as foretold at the end of the ramp, over the steepest.
    """
    lock.steep_slowing = max(min(2.0 * here - 1.0, MOST_SLOWING), min(2.0 * ahead - 1.0, FORETOLD_SLOWING), 0.0)
    lock.steep_periods = lock.steep_periods + 1 if here > 1.0 else 0
    if lock.steep_periods >= STEEP_PERIODS:
        lock.state = LOST


@kernel
def slowing_for_lag(lock: Record) -> float:
    """Return by how much of its rate a ramp has to be slower for its lag, which grows with the rate, not to slow it again."""
    if lock.largest_lag <= 1.0 - lock.begun_slowing:
        return 0.0
    return float(min(1.0 - (1.0 - lock.begun_slowing) / lock.largest_lag, MOST_LAG_SLOWING))


@kernel
def forget_lag(lock: Record) -> None:
    """Forget the lag of the present ramp, which a fault of the device has made."""
    lock.largest_lag, lock.lag_slowing = 0.0, lock.begun_slowing


@kernel
def begin_ramp(lock: Record) -> None:
    """Begin a ramp at the rate that the lag in the one before allows."""
    lock.begun_slowing = lock.lag_slowing = slowing_for_lag(lock)
    lock.largest_lag = 0.0


@kernel
def reacquire(lock: Record) -> None:
    """Return to ACQUIRING because a new level is being approached; a lost lock may be sought again."""
    lock.out_of_band_periods = 0
    lock.in_band_periods = 0
    lock.net_out_of_band_periods = 0
    lock.side = lock.swings = lock.steep_periods = 0
    lock.state = ACQUIRING
