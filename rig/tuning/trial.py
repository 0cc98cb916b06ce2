"""A trial of a tuned plan: it is carried out once, and the plan keeps the range of levels that was held."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from rig.arming.run_options import RunOptions
from rig.bench import Bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.ramps import Ramp, ramps_in
from rig.campaigns.evaluation.point import Point, Quality
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.running.runner import run_plan
from rig.tuning.levels import LevelChoice
from rig.tuning.linear_test import LIMITS
from rig.tuning.plant import TuningError

PURPOSE = "trial of a tuned plan"  # purpose of its recording, in the facts of its parts
IN_ORDER = (
    "completed",
    "plan_stopped",
    "no_lock",
    "no_lock_in_window",
    *LIMITS,
    "overtravel",
    "over_level",
    "lost_lock",
)
"""Ends of a trial that say how far the levels reach; any other end says something of the rig, or of who stopped it."""
MIN_HELD_SPAN = 1.15  # highest level over lowest that a trial has to hold, if more was planned; chosen
AS_ROUNDING = (Quality.REJECTED, Quality.NOT_SETTLED, Quality.DISTURBED)
"""Qualities of levels that rounding may spoil. Others are no better further up: a lock that is lost, a limit that is near."""
TOO_LARGE = (Quality.LOST_LOCK, Quality.TOO_STEEP, Quality.NEAR_LIMIT)
"""Qualities of levels at which a structure may be too nonlinear."""
REPEATED_WITHIN = 1.5  # the force of the same level in another trial, as a factor; chosen
LOWERED = 2.0  # highest level over lowest, where levels are lowered; chosen
DRIFT_WITHIN = 0.6  # of what the plan accepts; chosen: where rounding moves the force, the next record drifts otherwise
SETTLED_WITHIN = 0.5  # of the longest time allowed for it: a level that takes longer may not settle next time; chosen
NONHARMONIC_WITHIN = 0.5  # of what the plan accepts; chosen: repeated levels differed by a half


class TrialEndedError(TuningError):
    """A trial was stopped or failed for another reason than its levels: nothing is known of the plan."""


@dataclass(frozen=True, kw_only=True)
class PlanTrial:
    """How a plan was carried out in its trial."""

    recording: Path
    """Its recording."""
    points: tuple[Point[object], ...]
    """Its points, in the order of their levels."""
    end: str
    """How it ended, in a sentence."""
    tripped: bool
    """Whether it tripped."""
    judged_channels: tuple[int, ...]
    """Places of force and drive among the channels."""
    accepted_drift: float
    """Relative change of force and drive over a record that the plan accepts."""
    longest_settling: float
    """Periods that the plan allows a level to settle."""
    accepted_nonharmonic: float
    """Part of the force away from its harmonics that the plan accepts."""
    ramps: tuple[Ramp, ...] = ()
    """Its ramps from level to level."""

    @property
    def accepted(self) -> int:
        """Number of accepted points."""
        return sum(point.accepted for point in self.points)

    @property
    def held(self) -> Sequence[int]:
        """Levels in a row that were accepted, with something to spare, as numbers from 0: the longest such row."""
        held = [point.number for point in self.points if point.accepted and not self._spoiling(point)]
        rows = [[k for _, k in row] for _, row in groupby(enumerate(held), lambda entry: entry[1] - entry[0])]
        return max(rows, key=len, default=[])

    def _spoiling(self, point: Point[object]) -> str:
        """What of an accepted point may spoil it next time; empty if nothing."""
        if (periods := point.settle_periods or 0.0) > SETTLED_WITHIN * self.longest_settling:
            return f"took {periods:.0f} periods to settle"
        if (found := point.nonharmonic_force or 0.0) > NONHARMONIC_WITHIN * self.accepted_nonharmonic:
            return f"{100.0 * found:.2g} % of the force's RMS was not harmonic"
        spectrum = None if point.vibration is None else point.vibration.spectrum
        if spectrum is None or spectrum.drift is None:
            return ""
        drift = float(np.max(np.abs(spectrum.drift[list(self.judged_channels)])))
        return f"force or drive changed by {100.0 * drift:.1f} %" if drift > DRIFT_WITHIN * self.accepted_drift else ""

    @property
    def missing(self) -> str:
        """The first level that was not held, and why; empty if all were."""
        point = self._first_missing()
        if point is None:
            return self.end if self.tripped else ""
        if point.quality is Quality.INTERRUPTED:
            return self.end
        why = self._spoiling(point) if point.accepted else point.reason or str(point.quality)
        return f"level {point.number + 1}: {why}"

    @property
    def is_disturbed(self) -> bool:
        """Whether levels were not held, and all of these for what rounding may have caused."""
        fit = all(point.accepted or point.quality in AS_ROUNDING for point in self.points)
        return fit and not self.tripped and self._first_missing() is not None

    def _first_missing(self) -> Point[object] | None:
        return next((point for point in self.points if not point.accepted or self._spoiling(point)), None)

    def held_span(self, planned: LevelChoice) -> float:
        """Highest level that was held over the lowest; 0 if fewer than two were, or than the plan has."""
        held, levels = self.held, planned.levels_m
        return levels[held[-1]] / levels[held[0]] if len(held) >= min(2, len(levels)) else 0.0

    def lower_levels(self, planned: LevelChoice) -> LevelChoice | None:
        """Return levels below those planned, where too few of the lowest were held, and those above were too large.

        A structure may be nonlinear from the lowest level on that is free of rounding by the estimate.
        """
        held, missing = self.held, self._first_missing()
        if self.held_span(planned) >= self._needed_span(planned) or self.tripped or missing is None:
            return None
        if missing.number != len(held) or missing.quality not in TOO_LARGE:
            return None
        highest = planned.levels_m[held[-1] if held else 0]
        why = f"those planned were too large in a trial ({self.missing}; {self.recording.name})"
        return planned.within(highest / LOWERED, highest, why)

    def finer_levels(self, planned: LevelChoice) -> LevelChoice | None:
        """Return twice as many steps, where a level seems implausible after one that was held: a joint that slips between
        them changes the force as much as a sensor that fails.
        """  # noqa: D205
        missing, points = self._first_missing(), 2 * len(planned.levels_m) - 1
        if missing is None or missing.quality is not Quality.IMPLAUSIBLE or missing.number - 1 not in self.held:
            return None
        why = f"steps half as large, for a level was implausible in a trial ({self.missing}; {self.recording.name})"
        return planned.within(planned.levels_m[0], planned.levels_m[-1], why, points)

    def check_repeats(self, other: "PlanTrial") -> None:
        """Raise `TuningError` unless the lowest level took about the force that it took in another trial.

        A joint that slips above it does so again; a sensor that has failed on the way stays as it is.
        """
        first, second = (next((p.vibration for p in one.points if p.number == 0), None) for one in (other, self))
        if first is None or second is None:
            return
        if max(first.force_n, second.force_n) > REPEATED_WITHIN * min(first.force_n, second.force_n):
            raise TuningError(
                f"the lowest level took {first.force_n:.3g} N in one trial and {second.force_n:.3g} N in the next; in the one "
                f"before {other.missing}; recorded in {other.recording} and {self.recording}"
            )

    def levels(self, planned: LevelChoice) -> LevelChoice:
        """Return the levels of the plan within the range that was held; the planned ones if all were.

        Raises `TuningError` if no range was held.
        """
        held, levels, needed = self.held, planned.levels_m, self._needed_span(planned)
        if self.held_span(planned) < needed:
            raise TuningError(
                f"a trial of the plan held {len(held)} of {len(levels)} levels in a row, needed is a factor of {needed:.3g} "
                f"between the lowest and the highest: {self.missing or self.end}; recorded in {self.recording}"
            )
        lowest, highest = levels[held[0]], levels[held[-1]]
        if (lowest, highest) == (levels[0], levels[-1]):
            return planned
        return planned.within(lowest, highest, f"the range that a trial of the plan held ({self.recording.name})")

    def _needed_span(self, planned: LevelChoice) -> float:
        return min(MIN_HELD_SPAN, planned.span)


def carried_out(plan: BackbonePlan, bench: Bench, recording: Path, options: RunOptions) -> PlanTrial:
    """Carry out a plan and say how it went.

    Raises `TrialEndedError` if the run ended for another reason than a level out of reach.
    """
    options = replace(options, about=replace(options.about, purpose=PURPOSE))
    once = plan.model_copy(update={"lost_lock_attempts": 1})  # a level that needs a second attempt is not held
    with run_plan(once, bench, recording, options) as recorded:
        end, points = recorded.parts[-1].end, points_of(recorded)
        if end is None or end["reason"] not in IN_ORDER:
            text = "" if end is None else end["text"]
            raise TrialEndedError(f"trial of the plan: {text}; recorded in {recording}")
        ramps = ramps_in(recorded.parts[0], plan, bench.sample_rate_hz)
    return PlanTrial(
        recording=recording,
        points=tuple(sorted((point for point in points if not point.repeats_first), key=lambda point: point.number)),
        end=end["text"],
        tripped=bool(end["tripped"]),
        judged_channels=(bench.index_of("force"), bench.index_of("drive")),
        accepted_drift=plan.accepted_drift,
        longest_settling=plan.settle_rule.longest_periods,
        accepted_nonharmonic=plan.accepted_nonharmonic_force,
        ramps=ramps,
    )
