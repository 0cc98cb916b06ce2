"""The stepped-phase campaign: step through lags on both sides of resonance at a constant level, also on unstable branches."""

import math
from dataclasses import replace
from itertools import product
from operator import attrgetter
from typing import Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from rig.campaigns.planning.levels import ONE_LEVEL_KEY, exactly_one
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import Target, passes, with_first_repeated
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment
from vibrolock.errors import InputError

LAGS_DEG = (-175.0, -5.0)  # between these lags the force feeds the vibration, and the lag determines the frequency


class SteppedPhasePlan(SettledPlan):
    """Frequency responses at constant level, stepped through the phase instead of the frequency.

    The frequency follows the requested phase lag. At a fold of the response, where one frequency has three vibrations, every
    lag still has only one. Each level is approached from ``start_v`` at the first lag.
    """

    model_config = ConfigDict(
        json_schema_extra={"allOf": [ONE_LEVEL_KEY, exactly_one(("phase_lags_deg",), ("start_deg", "stop_deg"))]}
    )

    kind: Literal["stepped-phase"] = "stepped-phase"
    """Kind of campaign."""
    phase_lags_deg: tuple[float, ...] | None = Field(None, min_length=1)
    """Lags of the drive-point acceleration behind the force, deg. Give either these or ``start_deg`` and ``stop_deg``."""
    start_deg: float | None = None
    """Lowest lag, deg; -90 is phase resonance, and lower lags lie below resonance in frequency."""
    stop_deg: float | None = None
    """Highest lag, deg."""
    step_deg: float = Field(10.0, gt=0, le=90)
    """Distance of neighbouring lags, deg; the last step may be shorter."""
    direction: Literal["up", "down", "up-down"] = "up"
    """Whether the lag rises, falls, or rises and falls."""
    repeat_first: bool = False
    """Whether the first point is measured again at the end to reveal a drift of the specimen. The repeated point enters no
    result."""
    approach_deg: float | None = None
    """Lag at which a level is approached before the step to the first lag, deg; by default the first lag."""
    approach_periods: float = Field(40.0, ge=1, le=1e5)
    """Length of the ramp to a level, periods."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp from one lag to the next, periods."""
    record_periods: int = Field(20, ge=4, le=1_000_000)
    """Periods recorded and evaluated at each point."""
    accepted_level_error: float = Field(0.01, gt=0, le=1)
    """Largest relative error of the held force or response over the record with which a point is accepted."""

    @model_validator(mode="after")
    def _lags_make_sense(self) -> Self:
        given = [name for name in ("start_deg", "stop_deg") if getattr(self, name) is not None]
        if (self.phase_lags_deg is not None) == bool(given) or len(given) == 1:
            raise ValueError("phase_lags_deg, or start_deg and stop_deg: exactly one of the two must be given")
        low, high = LAGS_DEG
        named = [(name, getattr(self, name)) for name in (*given, "approach_deg")]
        named += [(f"phase_lags_deg[{index}]", lag) for index, lag in enumerate(self.phase_lags_deg or ())]
        for name, lag in named:
            if lag is not None and not low <= lag <= high:
                raise InputError(field=name, value=lag, allowed=f"{low:g} to {high:g}")
        if self.start_deg is not None and self.stop_deg is not None and not self.start_deg < self.stop_deg:
            raise InputError(
                field="stop_deg",
                value=self.stop_deg,
                allowed="above `start_deg`",
                hint="`direction` says which way to go",
            )
        if len(set(self.lags)) != len(self.lags):
            raise InputError("a lag is given twice", field="phase_lags_deg", hint="use repeats to measure lags again")
        if self.controller.phase_lag_deg != -90.0:
            raise InputError(
                "the plan gives the lags, leave it out",
                field="controller.phase_lag_deg",
                value=self.controller.phase_lag_deg,
            )
        if self.controller.detector == "sign" and self.lags != (-90.0,):
            raise InputError(
                "it knows phase resonance only",
                field="controller.detector",
                value="sign",
                allowed="two-phase or adaptive",
            )
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels, lags, directions and repeats."""
        if self.start_deg is None or self.stop_deg is None:
            lags = {"phase_lags_deg": len(self.phase_lags_deg or ())}
        else:
            lags = {"step_deg": max(1, math.ceil(min(1e9, (self.stop_deg - self.start_deg) / self.step_deg)) + 1)}
        return {**super().counts, **lags, "direction": 2 if self.direction == "up-down" else 1}

    @property
    def asked_lags_deg(self) -> tuple[float, ...]:
        """All lags that are held, deg."""
        return self.lags if self.approach_deg is None else tuple(sorted({*self.lags, self.approach_deg}))

    @property
    def lags(self) -> tuple[float, ...]:
        """All lags, rising, deg."""
        if self.start_deg is None or self.stop_deg is None:
            return tuple(sorted(self.phase_lags_deg or ()))
        steps = np.arange(self.start_deg, self.stop_deg - 1e-6 * self.step_deg, self.step_deg)
        return (*(float(lag) for lag in steps), self.stop_deg)

    def targets(self) -> tuple[Target, ...]:
        """Return all points: every lag at the first level, then at the next level, and so on."""
        targets = tuple(
            Target(number=number, level=level, direction=direction, repeat=repeat, phase_lag_deg=lag)
            for number, (level, repeat, (lag, direction)) in enumerate(
                product(self.levels, range(1, self.repeats + 1), passes(self.lags, self.direction))
            )
        )
        return with_first_repeated(targets) if self.repeat_first else targets

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``.

        A point whose predecessor is done is approached from the predecessor's lag, so that the direction of approach is the
        recorded one.
        """
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        out: list[Segment] = []
        at: int | None = None
        before: Target | None = None
        for target in self.targets():
            one_pass = attrgetter("level", "repeat", "repeats_first")
            origin = before if before is not None and one_pass(before) == one_pass(target) else None
            before = target
            if target.number in done:
                continue
            if origin is None or origin.number != at:
                out += self._approach(target, origin)
            point = Segment(
                SegmentKind.RAMP,
                target.number,
                target.level,
                self.ramp_periods,
                on_lost_lock=lost,
                lag_deg=target.phase_lag_deg,
                geometric=True,
            )
            failing = replace(point, on_failure=failure)
            settle = replace(failing, kind=SegmentKind.SETTLE, periods=self.settle.longest_periods)
            record = replace(failing, kind=SegmentKind.RECORD, periods=self.record_periods + 1.0)
            out += [point, settle, record]
            at = target.number
        return tuple(out)

    def _approach(self, target: Target, origin: Target | None) -> list[Segment]:
        """Return the segments that approach the target's level, at ``approach_deg`` and then at the lag of ``origin``."""
        first = _lag(origin or target) if self.approach_deg is None else self.approach_deg
        ramp = Segment(SegmentKind.RAMP, -1, target.level, self.approach_periods, lag_deg=first, geometric=True)
        hold = replace(ramp, kind=SegmentKind.HOLD, periods=float(2 * self.settle.average_periods))
        out = [*self.start_segments(lag_deg=first), ramp]
        if origin is not None and _lag(origin) != first:
            steps = max(1.0, abs(_lag(origin) - first) / self.step_deg)
            out += [hold, replace(ramp, lag_deg=_lag(origin), periods=steps * self.ramp_periods)]
        return [*out, replace(hold, lag_deg=_lag(origin))] if origin is not None else out


def _lag(target: Target) -> float:
    return 0.0 if target.phase_lag_deg is None else target.phase_lag_deg
