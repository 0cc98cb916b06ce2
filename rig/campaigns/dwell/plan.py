"""The dwell campaign: track phase resonance at one level for a given time or number of cycles."""

from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.levels import ONE_LEVEL_KEY, exactly_one
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import Target
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Segment
from vibrolock.errors import InputError

FEWEST_PERIODS = 10
"""Fewest periods of a mean from which frequency and damping can be identified."""


class DriftLimits(Configured):
    """Limits on relative changes from the first mean, of either sign. A quantity without a limit is not monitored."""

    frequency: float | None = Field(None, gt=0, le=1)
    """Relative change of the modal frequency."""
    damping: float | None = Field(None, gt=0, le=100)
    """Relative change of the damping ratio."""
    amplitude: float | None = Field(None, gt=0, le=100)
    """Relative change of the displacement amplitude at the drive point; if the displacement is held, of the force."""


class DwellPlan(SettledPlan):
    """One level held at phase resonance while the specimen ages, as in a fatigue test.

    The vibration is settled once. From then on it is evaluated without a gap in means over ``mean_s``. Each mean is a point of
    the recording: frequency, damping and amplitude over the cycles. All rows are stored for every ``record_every``-th mean, the
    first and the last. For the other means one row every ``telemetry_s`` is stored, so that the file of a ten-hour test stays
    small.
    """

    model_config = ConfigDict(json_schema_extra={"allOf": [ONE_LEVEL_KEY, exactly_one(("cycles",), ("duration_s",))]})

    kind: Literal["dwell"] = "dwell"
    """Kind of campaign."""
    cycles: int | None = Field(None, ge=FEWEST_PERIODS, le=10**12)
    """Number of cycles at the level. Give either this or ``duration_s``."""
    duration_s: float | None = Field(None, gt=0, le=1e7)
    """Time at the level, s. Give either this or ``cycles``."""
    mean_s: float = Field(10.0, gt=0, le=3600)
    """Length of a mean, s. With ``cycles``, a mean has the nearest whole number of periods of
    ``controller.centre_frequency_hz``."""
    record_every: int = Field(60, ge=1, le=10_000)
    """Interval, in means, at which all rows of a mean are stored."""
    ramp_periods: float = Field(40.0, ge=1, le=1e5)
    """Length of the ramp to the level, periods."""
    alarm: DriftLimits = DriftLimits()
    """Changes from the first mean that cause a warning. The test goes on."""
    abort: DriftLimits = DriftLimits()
    """Changes from the first mean at which the output is ramped down and the test ends."""
    accepted_level_error: float = Field(0.01, gt=0, le=1)
    """Largest relative error of a held force or displacement over a mean with which the mean is accepted."""
    on_failure: Literal["stop"] = "stop"
    """A mean that is disturbed ramps the output down and ends the test: nothing settles the vibration again before the next."""
    on_lost_lock: Literal["stop"] = "stop"
    """A lost lock trips."""
    repeats: Literal[1] = 1
    """Always 1: a specimen ages only once."""
    retries: Literal[0] = 0
    """Always 0: the specimen would age while a mean is measured again."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if (self.cycles is None) == (self.duration_s is None):
            raise InputError("exactly one of the two must be given", field="cycles, duration_s")
        if len(self.levels) != 1:
            raise InputError(f"{len(self.levels)} levels", field=self.levels_key, allowed="exactly 1")
        lowest_hz = self.controller.frequency_window_hz[0]
        if self.mean_s * lowest_hz < FEWEST_PERIODS:
            raise InputError(
                field="mean_s",
                value=self.mean_s,
                allowed=f"from {FEWEST_PERIODS / lowest_hz:.3g} s, {FEWEST_PERIODS} periods at the lowest frequency of "
                "the window",
            )
        if self.duration_s is not None and self.duration_s < self.mean_s:
            raise InputError(field="duration_s", value=self.duration_s, allowed=f"from mean_s = {self.mean_s:g} s")
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Number of means, under the key that gives the length of the test."""
        return {"cycles" if self.cycles is not None else "duration_s": self.n_means}

    @property
    def mean_periods(self) -> int:
        """Periods of a mean if the length of the test is given in cycles."""
        return max(FEWEST_PERIODS, round(self.mean_s * self.controller.centre_frequency_hz))

    @property
    def n_means(self) -> int:
        """Number of means. The remainder of the test lengthens or shortens the last mean by up to half a mean."""
        whole = self.mean_s if self.duration_s is not None else float(self.mean_periods)
        length = self.duration_s if self.duration_s is not None else float(self.cycles or 0)
        return max(1, int(min(1e9, length / whole) + 0.5))

    def targets(self) -> tuple[Target, ...]:
        """Return all means in order."""
        return tuple(Target(number=number, level=self.levels[0]) for number in range(self.n_means))

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return start, ramp and settling, followed by one record for every mean that is not in ``done``."""
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        left = [target for target in self.targets() if target.number not in done]
        if not left:
            return ()
        level, first = self.levels[0], left[0].number
        out = self.start_segments()
        out.append(Segment(SegmentKind.RAMP, -1, level, self.ramp_periods, geometric=self.levels_key != "levels_v"))
        out.append(Segment(SegmentKind.SETTLE, first, level, self.settle.longest_periods, OnFailure.STOP, lost))
        for target in left:
            last = target.number == self.n_means - 1
            before = target.number
            if self.duration_s is not None:
                length_s = self.duration_s - before * self.mean_s if last else self.mean_s
                held = Segment(SegmentKind.RECORD, before, level, 0.0, failure, lost, duration_s=length_s)
            else:
                periods = (self.cycles or 0) - before * self.mean_periods if last else self.mean_periods
                held = Segment(SegmentKind.RECORD, before, level, float(periods), failure, lost)
            out.append(held)
        return tuple(out)

    def stores_record(self, number: int) -> bool:
        """Whether all rows of a mean are stored: of every ``record_every``-th and of the last."""
        return number % self.record_every == 0 or number == self.n_means - 1

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench cannot do, and damping limits if the damping cannot be determined."""
        super().check(bench)
        for name, limits in (("alarm", self.alarm), ("abort", self.abort)):
            if limits.damping is not None and drive_shape(bench, self.plant).value is None:
                raise ConfigurationError(
                    f"the damping is unknown, for the bench {bench.name} has no specimen.drive_mode_shape and the "
                    "plan no [plant]",
                    field=f"{name}.damping",
                    value=limits.damping,
                )
