"""The response-controlled campaign: hold the drive point's displacement while the phase lag steps through resonance."""

from itertools import product
from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.campaigns.planning.levels import ONE_LEVEL_KEY
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import Target, passes
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from vibrolock.errors import InputError

LEAST_SINE_LAG_DEG = 5.0  # chosen: closer to 0 or 180 deg the lag hardly changes with the frequency


class ResponseControlledPlan(SettledPlan):
    """Vibrations at given displacements of the drive point and given phase lags, from below resonance to above it.

    At a held displacement a nonlinear structure responds like a linear one: no folds, no jumps, one frequency at each lag.
    Points are given by lag, not by frequency, so that they stay around a resonance that shifts with the level.
    """

    model_config = ConfigDict(json_schema_extra={"allOf": [ONE_LEVEL_KEY, {"required": ["levels_m"]}]})

    kind: Literal["response-controlled"] = "response-controlled"
    """Kind of campaign."""
    phase_lags_deg: tuple[float, ...]
    """Lags of the drive-point acceleration behind the force, deg; -90 is phase resonance."""
    direction: Literal["up", "down", "up-down"] = "up"
    """Order of the lags at each level; ``up`` is rising frequency."""
    level_ramp_periods: float = Field(40.0, ge=1, le=1e5)
    """Length of the ramp from the last lag of one level to the first lag of the next level, periods."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp from one lag to the next, periods."""
    record_periods: int = Field(20, ge=4, le=1_000_000)
    """Periods recorded and evaluated at each point."""
    settle: SettleRule = SettleRule(settled_periods=10)
    """When a point counts as settled, by displacement, force and lag."""
    accepted_level_error: float = Field(0.01, gt=0, le=1)
    """Largest relative deviation of the recorded displacement from its level with which a point is accepted."""

    @model_validator(mode="after")
    def _lags_and_levels_make_sense(self) -> Self:
        if self.levels_m is None:
            raise InputError(field=self.levels_key, allowed="levels_m, for the displacement is held")
        if not self.phase_lags_deg:
            raise InputError("at least one lag is needed", field="phase_lags_deg", value=[])
        low, high = LEAST_SINE_LAG_DEG - 180.0, -LEAST_SINE_LAG_DEG
        for index, lag in enumerate(self.phase_lags_deg):
            InputError.unless_between(f"phase_lags_deg[{index}]", lag, low, high)
        if len(set(self.phase_lags_deg)) != len(self.phase_lags_deg):
            raise InputError("a lag is given twice", field="phase_lags_deg", hint="use repeats to measure points again")
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels, lags, directions and repeats."""
        ways = 2 if self.direction == "up-down" else 1
        return {**super().counts, "phase_lags_deg": len(self.phase_lags_deg), "direction": ways}

    @property
    def asked_lags_deg(self) -> tuple[float, ...]:
        """All lags that are held, deg."""
        return tuple(sorted(self.phase_lags_deg))

    def targets(self) -> tuple[Target, ...]:
        """Return all points: all lags at each level, the lowest level first. ``up-down`` passes the lags up, then down."""
        return tuple(
            Target(number=number, level=level, direction=direction, repeat=repeat, phase_lag_deg=lag)
            for number, (repeat, level, (lag, direction)) in enumerate(
                product(range(1, self.repeats + 1), sorted(self.levels), passes(self.phase_lags_deg, self.direction))
            )
        )

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``.

        A point whose predecessor is done is approached from the predecessor's lag, so that the direction of approach is the
        recorded one.
        """
        targets = self.targets()
        left = [target for target in targets if target.number not in done]
        out = self.start_segments() if left else []
        at: Target | None = None
        for target in left:
            before = targets[target.number - 1] if target.number else None
            on_the_way = before is not None and (before.level, before.repeat) == (target.level, target.repeat)
            if before is not None and on_the_way and before != at:
                out.append(self._ramp(at, before, -1))
                out.append(self._segment(SegmentKind.HOLD, before, -1, float(self.settle.shortest_periods)))
                at = before
            out.append(self._ramp(at, target, target.number))
            out.append(self._segment(SegmentKind.SETTLE, target, target.number, self.settle.longest_periods))
            out.append(self._segment(SegmentKind.RECORD, target, target.number, self.record_periods + 1.0))
            at = target
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        if self.controller.detector == "sign":
            raise ConfigurationError(
                field="controller.detector", value="sign", allowed="two-phase or adaptive, at lags other than -90"
            )
        super().check(bench)

    def _ramp(self, at: Target | None, target: Target, number: int) -> Segment:
        """Return the ramp to a point, from the previous lag or from another level."""
        on_the_way = at is not None and (at.level, at.repeat) == (target.level, target.repeat)
        periods = self.ramp_periods if on_the_way else self.level_ramp_periods
        return self._segment(SegmentKind.RAMP, target, number, periods)

    def _segment(self, kind: SegmentKind, target: Target, number: int, periods: float) -> Segment:
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        return Segment(
            kind,
            number,
            target.level,
            periods,
            failure,
            lost,
            amplitude_law=AmplitudeLaw.RESPONSE,
            lag_deg=target.phase_lag_deg,
            geometric=True,
        )
