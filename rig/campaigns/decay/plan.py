"""The decay campaign: settle at phase resonance, then take the output to 0 V at once and record how the vibration decays."""

from dataclasses import replace
from typing import Literal, Self

from pydantic import Field, model_validator

from rig.bench import Bench
from rig.campaigns.planning.locked import SettledPlan
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment
from vibrolock.errors import InputError


class DecayPlan(SettledPlan):
    """Decays from a series of levels, each beside the settled point that it begins at.

    Every level is approached by a ramp, settled by the rule in ``settle`` and recorded. Then the output goes to 0 V at once,
    and the decay is recorded. The exciter stays attached: what it does to the decay is taken out through the measured force,
    for which the plan needs the table ``[plant]``. All limits of the bench stay armed during the decay.
    """

    kind: Literal["decay"] = "decay"
    """Kind of campaign."""
    ramp_periods: float = Field(20.0, ge=1, le=1e5)
    """Length of the half-cosine ramp to a level, periods."""
    record_periods: int = Field(30, ge=10, le=1_000_000)
    """Periods that are recorded at the level before the release."""
    decay_periods: float = Field(60.0, ge=12, le=1e6)
    """Length of the decay, periods of the frequency at the release. The last quarter should be quiet: it shows the noise."""
    decay_levels: int = Field(10, ge=1, le=200)
    """Number of levels, in equal ratios of the amplitude, at which a decay is evaluated."""

    @model_validator(mode="after")
    def _no_harmonics_loop(self) -> Self:
        if self.controller.harmonics is not None:
            raise InputError(
                "not allowed with kind = 'decay', whose output is 0 V when it counts", field="controller.harmonics"
            )
        return self

    @property
    def evaluates_approach(self) -> bool:
        """The rows of a point begin with its ramp: settled record and decay are evaluated together."""
        return True

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``: each is approached from rest."""
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        out: list[Segment] = []
        for target in self.targets():
            if target.number in done:
                continue
            out += self.start_segments()
            ramp = Segment(SegmentKind.RAMP, target.number, target.level, self.ramp_periods, failure, lost)
            out.append(ramp)
            out.append(replace(ramp, kind=SegmentKind.SETTLE, periods=self.settle.longest_periods))
            out.append(replace(ramp, kind=SegmentKind.HOLD, periods=self.record_periods + 1.0))
            out.append(replace(ramp, kind=SegmentKind.RELEASE, periods=self.decay_periods))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        super().check(bench)
        if self.plant is None:
            raise ConfigurationError(
                "[plant] is missing: the exciter shakes the other modes during a decay, and only a measured plant tells their "
                "share; `rig tune` measures it"
            )
