"""The continuous backbone campaign: ramp the response level up and down without waiting, and evaluate every instant."""

from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.campaigns.planning.levels import ONE_LEVEL_KEY
from rig.campaigns.planning.locked import LockedPlan
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment
from vibrolock.errors import InputError


class ContinuousBackbonePlan(LockedPlan):
    """Phase-resonant vibrations whose level is ramped up and down without settling.

    From ``start_v`` the response loop takes over and goes to the lowest level, where the lock has ``lock_periods`` to be
    gained. Then the level rises to the highest and falls again, each way in ``sweep_periods`` and linearly in the logarithm of
    the level. The slow flow gives modal frequency and damping at every instant. The results at the given levels are means of
    the way up and the way down.
    """

    model_config = ConfigDict(json_schema_extra={"allOf": [ONE_LEVEL_KEY, {"required": ["levels_m"]}]})

    kind: Literal["continuous-backbone"] = "continuous-backbone"
    """Kind of campaign."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp to the lowest level, periods."""
    lock_periods: float = Field(10.0, ge=0, le=1e5)
    """Time at the lowest level before the way up, in which the lock is gained, periods."""
    sweep_periods: float = Field(ge=10, le=1e6)
    """Length of each of the two ways, up and down, periods."""
    end_periods: float = Field(0.0, ge=0, le=1e5)
    """Time at the lowest level after the way down, periods. The signal is weakest there, so noise matters most."""
    margin: float = Field(0.05, gt=0, le=1)
    """Relative margin by which the ramps pass below the lowest and above the highest of ``levels_m``."""
    bandwidth: float = Field(0.08, gt=0, le=1)
    """Half width of the band of amplitudes that are evaluated together for one level, in the logarithm of the amplitude. A
    bend within the band is smoothed."""
    accepted_nonharmonic_force: float = Field(0.25, gt=0, le=1)
    """Largest part of the force's RMS that is neither a harmonic nor noise with which a point is accepted. The default is
    wider than elsewhere, as oscillations while the lock is gained count too."""
    accepted_detuning: float = Field(0.03, gt=0, le=1)
    """Largest relative distance of the instantaneous frequency from the identified resonance; beyond it the lock counts as
    lost."""
    accepted_frequency_std: float = Field(1e-3, gt=0, le=1)
    """Largest relative standard error of the modal frequency with which a point is accepted."""
    accepted_damping_std: float = Field(0.1, gt=0, le=1)
    """Largest relative standard error of the damping with which a point is accepted. It includes the difference of up and down.
    """

    @model_validator(mode="after")
    def _in_metres(self) -> Self:
        if self.levels_m is None:
            raise InputError("a continuous backbone goes by the response", field=self.levels_key, allowed="levels_m")
        return self

    def together(self, number: int) -> frozenset[int]:
        """Return the numbers of all levels of the same repeat."""
        count = len(self.levels)
        first = number // count * count
        return frozenset(range(first, first + count))

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments of every repeat that is not completely ``done``: up and down over its missing levels."""
        failure = OnFailure[self.on_failure.upper()]
        targets, count = self.targets(), len(self.levels)
        out = self.start_segments()
        for first in range(0, len(targets), count):
            left = [target for target in targets[first : first + count] if target.number not in done]
            if not left:
                continue
            low, high = left[0].level / (1.0 + self.margin), left[-1].level * (1.0 + self.margin)
            # The ways up and down have different point numbers: if the way up fails, the way down is not skipped with it.
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
                f"beyond the highest level it leads to {highest:g} m; the bench {bench.name} allows up to "
                f"{allowed:.3g} m, where a channel reaches its {bench.limits.displacement_m:g} m",
                field="margin",
                value=self.margin,
            )
