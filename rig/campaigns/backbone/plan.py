"""The backbone campaign: step through levels at phase resonance; settle and record whole periods at each level."""

from dataclasses import replace
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from controller.harmonics import MOST_HARMONICS, check_wanted
from rig.bench import Bench
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import MOST_POINTS, Target, passes, with_first_repeated
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment
from vibrolock.errors import InputError


class BackbonePlan(SettledPlan):
    """Phase-resonant vibrations at a series of levels.

    The levels are amplitudes of the output voltage (``levels_v``, as in the paper), or of force or response, which the control
    loops then hold. Every point is approached by a half-cosine ramp, settled by the rule in ``settle``, and recorded over whole
    periods.
    """

    kind: Literal["backbone"] = "backbone"
    """Kind of campaign."""
    direction: Literal["up", "down", "up-down"] = "up"
    """Order of the levels; ``up-down`` measures the highest level once."""
    repeat_first: bool = False
    """Whether the first point is measured again at the end to reveal a drift of the specimen. The repeated point enters no
    result."""
    ramp_periods: float = Field(20.0, ge=1, le=1e5)
    """Length of the half-cosine ramp between two levels, periods."""
    ramp_factors: tuple[Annotated[float, Field(ge=0.1, le=100)], ...] = Field((), max_length=MOST_POINTS)
    """How many times as long the ramp to each level is, one number for every level; none: all ramps are of the same length.
    Where a backbone becomes steep at once, as where a stop is met, the phase lags less in a longer ramp."""
    record_periods: int = Field(50, ge=4, le=1_000_000)
    """Periods that are evaluated at each level; one more is recorded."""
    force_harmonics: tuple[dict[int, tuple[float, float]], ...] = Field((), max_length=1000)
    """Harmonics of the force that are prescribed one after the other at every level, each set for a point of its own; as
    `wanted` of the harmonics loop, in place of which they are used. For data in which the exciter's harmonics vary."""
    evaluation: Literal["settled", "slow-flow"] = "settled"
    """How a point is evaluated. ``settled``: wait until the vibration has settled, then record. ``slow-flow``: evaluate the
    ramp to the point and the time at the point by the slow flow, without waiting for a steady state."""
    accepted_frequency_std: float = Field(1e-3, gt=0, le=1)
    """Largest relative standard error of the modal frequency with which a slow-flow point is accepted."""
    accepted_damping_std: float = Field(0.1, gt=0, le=1)
    """Largest relative standard error of the damping with which a slow-flow point is accepted."""

    @model_validator(mode="after")
    def _harmonics_possible(self) -> Self:
        loop = self.controller.harmonics
        if self.force_harmonics and loop is None:
            raise InputError("need the table controller.harmonics, the loop that makes them", field="force_harmonics")
        for index, wanted in enumerate(self.force_harmonics):
            check_wanted(f"force_harmonics[{index}]", wanted, MOST_HARMONICS if loop is None else loop.highest)
        return self

    @model_validator(mode="after")
    def _one_factor_a_level(self) -> Self:
        if self.ramp_factors and len(self.ramp_factors) != len(self.levels):
            text = f"{len(self.ramp_factors)} numbers for {len(self.levels)} levels"
            raise InputError(text, field="ramp_factors", allowed="one for each")
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels, directions and repeats."""
        directions = 2 if self.direction == "up-down" else 1
        return {**super().counts, "direction": directions, "force_harmonics": max(1, len(self.force_harmonics))}

    @property
    def evaluates_approach(self) -> bool:
        """Whether the ramp is evaluated together with the time at the point, as the slow flow does."""
        return self.evaluation == "slow-flow"

    def targets(self) -> tuple[Target, ...]:
        """Return all points in the order of measurement."""
        targets = tuple(
            Target(number=number, level=level, direction=direction, repeat=repeat, harmonics=harmonics)
            for number, (repeat, level, direction, harmonics) in enumerate(
                (repeat, level, direction, harmonics)
                for repeat in range(1, self.repeats + 1)
                for level, direction in passes(self.levels, self.direction)
                for harmonics in self.force_harmonics or (None,)
            )
        )
        return with_first_repeated(targets) if self.repeat_first else targets

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``.

        A point whose predecessor is done is approached from the predecessor's level, so that the direction of approach is the
        recorded one.
        """
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        targets = self.targets()
        left = [target for target in targets if target.number not in done]
        out = self.start_segments() if left else []
        at: float | None = None
        for target in left:
            before = self._approach(targets, target)
            if before is not None and before != at:
                out.append(Segment(SegmentKind.RAMP, -1, before, self._ramp_periods(before), on_lost_lock=lost))
                out.append(Segment(SegmentKind.HOLD, -1, before, self._hold_periods))
            number, level = target.number, target.level
            at, first = level, at is None and before is None
            if self.evaluation == "slow-flow":
                out += self._short_point(target, failure, lost, first)
                continue
            ramp = Segment(
                SegmentKind.RAMP, number, level, self._ramp_periods(level), failure, lost, harmonics=target.harmonics
            )
            out.append(ramp)
            out.append(replace(ramp, kind=SegmentKind.SETTLE, periods=self.settle.longest_periods))
            out.append(replace(ramp, kind=SegmentKind.RECORD, periods=self.record_periods + 1.0))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        super().check(bench)
        if self.evaluation == "slow-flow":
            self._check_slow_flow(bench)

    def _short_point(self, target: Target, failure: OnFailure, lost: OnFailure, first: bool) -> list[Segment]:
        """Return the ramp to a point and the time at the point, both evaluated.

        Before the first point, gain the lock at its level.
        """
        number, level = target.number, target.level
        geometric = self.levels_key != "levels_v"
        ramp = Segment(
            SegmentKind.RAMP,
            number,
            level,
            self._ramp_periods(level),
            failure,
            lost,
            geometric=geometric,
            harmonics=target.harmonics,
        )
        waits = SegmentKind.START if self.levels_key == "levels_v" else SegmentKind.HOLD  # the others started before
        out = [replace(ramp, point=-1), replace(ramp, kind=waits, point=-1, periods=self._hold_periods)]
        # A ramp from a level to the same level: the point is judged by its slow flow, not by the settle rule.
        held = replace(ramp, kind=SegmentKind.LEVEL_SWEEP, periods=self.record_periods)
        return [*(out if first else ()), ramp, held]

    def _ramp_periods(self, level: float) -> float:
        factors = dict(zip(self.levels, self.ramp_factors, strict=True)) if self.ramp_factors else {}
        return self.ramp_periods * factors.get(level, 1.0)

    @property
    def _hold_periods(self) -> float:
        return float(2 * self.settle.average_periods + self.settle.settled_periods)

    @staticmethod
    def _approach(targets: tuple[Target, ...], target: Target) -> float | None:
        """Return the level from which a point is approached: the previous one if it is on the correct side; None: from rest."""
        if target.number == 0:
            return None
        before = targets[target.number - 1].level
        as_recorded = (target.level > before) == (target.direction == "up")
        return (
            before if as_recorded or target.level == before else None
        )  # the same level has other harmonics of the force
