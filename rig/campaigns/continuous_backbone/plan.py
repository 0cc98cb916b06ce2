"""The continuous backbone: the response level goes up and down without ever waiting, and every instant is a measurement."""

from typing import Literal, Self

from pydantic import Field, model_validator

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Target
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment

__all__ = ["ContinuousBackbonePlan"]


class ContinuousBackbonePlan(LockedPlan):
    """Phase-resonant vibrations whose level is ramped up and down; nothing settles.

    From ``start_v`` the response's loop takes over and goes to the lowest level, where the lock has ``lock_periods`` to be
    gained. Then the level goes up to the highest and down again, by its logarithm, in ``sweep_periods`` each way. The slow flow
    gives modal frequency and damping at every instant; results are means of up and down at the levels that are given.
    """

    kind: Literal["continuous-backbone"] = "continuous-backbone"
    """Kind of campaign."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp to the lowest level, periods."""
    lock_periods: float = Field(10.0, ge=0, le=1e5)
    """Time at the lowest level before the way up, for the lock to be gained, periods."""
    sweep_periods: float = Field(ge=10, le=1e6)
    """Length of the way up, and of the way down, periods."""
    end_periods: float = Field(0.0, ge=0, le=1e5)
    """Time at the lowest level after the way down: noise counts most there, periods."""
    margin: float = Field(0.05, gt=0, le=1)
    """How far the level goes beyond the lowest and highest of ``levels_m``, relative."""
    bandwidth: float = Field(0.08, gt=0, le=1)
    """Half width, in the logarithm of the amplitude, of what is taken together for one level."""
    accepted_alien_force: float = Field(0.25, gt=0, le=1)
    """As of every plan under a lock, but wider: what swings while the lock is gained stands beside the harmonics."""
    accepted_detuning: float = Field(0.03, gt=0, le=1)
    """Largest distance of the momentary frequency from the resonance found, relative; beyond, the lock is lost."""
    accepted_frequency_std: float = Field(1e-3, gt=0, le=1)
    """Largest standard error of the modal frequency, relative, with which a point is accepted."""
    accepted_damping_std: float = Field(0.1, gt=0, le=1)
    """Largest standard error of the damping, relative, with which a point is accepted; up less down is part of it."""

    @model_validator(mode="after")
    def _in_metres(self) -> Self:
        if self.levels_m is None:
            raise ValueError(f"{self.levels_key}: a continuous backbone goes by the response, allowed is levels_m")
        return self

    def targets(self) -> tuple[Target, ...]:
        """The levels of every repeat, rising."""
        pairs = ((repeat, level) for repeat in range(1, self.repeats + 1) for level in sorted(self.levels))
        return tuple(Target(number=n, level=level, repeat=repeat) for n, (repeat, level) in enumerate(pairs))

    def together(self, number: int) -> frozenset[int]:
        """All levels of one repeat."""
        count = len(self.levels)
        first = number // count * count
        return frozenset(range(first, first + count))

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """The segments of every repeat that is not ``done`` in full: up and down over the levels it lacks."""
        failure = OnFailure[self.on_failure.upper()]
        targets, count = self.targets(), len(self.levels)
        out = self.start_segments()
        for first in range(0, len(targets), count):
            left = [target for target in targets[first : first + count] if target.number not in done]
            if not left:
                continue
            low, high = left[0].level / (1.0 + self.margin), left[-1].level * (1.0 + self.margin)
            # The ways up and down bear different numbers: should the first fail, the second is not passed over with it.
            up, down = left[0].number, left[-1].number
            out.append(Segment(SegmentKind.RAMP, up, low, self.ramp_periods, failure, geometric=True))
            if self.lock_periods > 0.0:
                out.append(Segment(SegmentKind.HOLD, up, low, self.lock_periods))
            out.append(Segment(SegmentKind.LEVEL_SWEEP, up, high, self.sweep_periods, failure, geometric=True))
            out.append(Segment(SegmentKind.LEVEL_SWEEP, down, low, self.sweep_periods, failure, geometric=True))
            if self.end_periods > 0.0:
                out.append(Segment(SegmentKind.HOLD, down, low, self.end_periods))
        return tuple(out) if len(out) > len(self.start_segments()) else ()

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        super().check(bench)
        self._check_slow_flow(bench)
        highest = max(self.levels) * (1.0 + self.margin)
        allowed = bench.limits.displacement_m / max(self.ratios_to_drive(bench).values())
        if self.amplitude_law is AmplitudeLaw.RESPONSE and highest > allowed:
            raise ConfigurationError(
                f"margin = {self.margin:g}: beyond the highest level it leads to {highest:g} m; the bench {bench.name} "
                f"allows up to {allowed:.3g} m, where a channel reaches its {bench.limits.displacement_m:g} m"
            )
