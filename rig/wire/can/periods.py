"""How the outputs of a block go on, told by frames of their own that hold until the next one (version 2)."""

TOLD_EVERY_S = 0.01
"""Shortest time between two frames that only tell another period."""


def _later(period: int, ramp: int, samples: int) -> tuple[int, int]:
    """Period and ramp so many samples later; a ramp that is over by then leaves nothing to go on with."""
    if ramp == 0:
        return period, 0
    return (period, ramp - samples) if ramp > samples else (0, 0)


class PeriodsTold:
    """The host's end: what it has told the device, and when it has to tell more."""

    def __init__(self, rate_hz: float) -> None:
        self._every = TOLD_EVERY_S * rate_hz
        self._first, self._period, self._ramp = 0, 0, 0
        self._is_known = True

    def must_tell(self, first: int, period: int, ramp: int) -> bool:
        """Whether a frame goes before the block from sample ``first`` on; then it counts as told."""
        known_period, known_ramp = _later(self._period, self._ramp, first - self._first)
        if self._is_known and (period, ramp) == (known_period, known_ramp):
            return False
        begins_or_ends = not self._is_known or (period == 0) != (known_period == 0) or ramp != known_ramp
        if not begins_or_ends and first - self._first < self._every:
            return False
        self._first, self._period, self._ramp, self._is_known = first, period, ramp, True
        return True

    def forget(self) -> None:
        """Note that a frame may not have been sent: the next block is told anew."""
        self._is_known = False


class PeriodsHeard:
    """The device's end."""

    def __init__(self) -> None:
        self._first, self._period, self._ramp = 0, 0, 0
        self._is_new = False

    def hear(self, period: int, ramp: int) -> None:
        """Take a frame, which holds from the next block on."""
        self._period, self._ramp, self._is_new = period, ramp, True

    def of(self, first: int) -> tuple[int, int]:
        """Period and ramp of the block from sample ``first`` on."""
        if self._is_new:
            self._first, self._is_new = first, False
        return _later(self._period, self._ramp, first - self._first)
