"""The sweep campaign: a tone whose frequency moves from one end to the other, at constant voltage or at a held level."""

import math
from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.campaigns.planning.levels import ONE_LEVEL_KEY, exactly_one
from rig.campaigns.planning.plan import Target, TonePlan
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from vibrolock.errors import InputError

FEWEST_PERIODS = 10  # the fundamental is a mean over two periods; fewer than ten show no variation of it
LONGEST_S = 86400.0  # one day


class SweepPlan(TonePlan):
    """Sweeps, one per level, at constant voltage or at held force or displacement.

    With levels in volts the force results from shaker and structure; with levels in newtons or metres a loop holds the level as
    well as it can. Starting from rest, the level is reached at the first frequency by a half-cosine ramp and held for
    ``hold_periods``. Then the frequency moves, linearly or logarithmically in time. Every row is recorded.
    """

    model_config = ConfigDict(
        json_schema_extra={"allOf": [ONE_LEVEL_KEY, exactly_one(("rate_hz_per_s",), ("rate_octaves_per_min",))]}
    )

    kind: Literal["sweep"] = "sweep"
    """Kind of campaign."""
    start_hz: float = Field(gt=0)
    """First frequency, Hz."""
    stop_hz: float = Field(gt=0)
    """Last frequency, Hz; below ``start_hz`` to sweep down."""
    rate_hz_per_s: float | None = Field(None, gt=0, le=1e5)
    """Rate of a linear sweep, up or down, Hz/s. Give either this or ``rate_octaves_per_min``. The sweep has at least 10
    periods."""
    rate_octaves_per_min: float | None = Field(None, gt=0, le=1e4)
    """Rate of a logarithmic sweep, instead of ``rate_hz_per_s``, octaves/min."""
    ramp_periods: float = Field(20.0, ge=1, le=1e5)
    """Length of the ramp to the level, and down from it, periods."""
    hold_periods: float = Field(20.0, ge=1, le=1e5)
    """Time at the first frequency before the sweep, periods."""
    off_resonance_hz: tuple[tuple[float, float], ...] | None = Field(None, min_length=1)
    """Frequency bands that define the force off resonance (the mean of their medians); by default the first 15 %."""
    accepted_level_error: float = Field(0.2, gt=0, le=1)
    """Largest relative deviation of a held force or displacement from its level, over three quarters of a sweep, with which the
    sweep is accepted. The remaining quarter allows for jumps. It is not used with levels in volts."""

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if (self.rate_hz_per_s is None) == (self.rate_octaves_per_min is None):
            raise InputError("exactly one of the two must be given", field="rate_hz_per_s, rate_octaves_per_min")
        if self.start_hz == self.stop_hz:
            raise InputError(field="stop_hz", value=self.stop_hz, allowed="anything but start_hz")
        mean_hz = 0.5 * (self.start_hz + self.stop_hz)
        if self.rate_hz_per_s is None:
            mean_hz = (self.stop_hz - self.start_hz) / math.log(self.stop_hz / self.start_hz)
        periods = mean_hz * self.sweep_s
        name = "rate_hz_per_s" if self.rate_hz_per_s is not None else "rate_octaves_per_min"
        rate = self.rate_hz_per_s or self.rate_octaves_per_min or 0.0
        if self.sweep_s > LONGEST_S:
            least = rate * self.sweep_s / LONGEST_S
            raise InputError(field=name, value=rate, allowed=f"from {least:.4g}, a sweep of a day")
        if periods < FEWEST_PERIODS:
            raise InputError(
                field=name,
                value=rate,
                allowed=f"up to {rate * periods / FEWEST_PERIODS:.4g} from {self.start_hz:g} to {self.stop_hz:g} Hz, a "
                f"sweep of {FEWEST_PERIODS} periods",
            )
        low, high = sorted((self.start_hz, self.stop_hz))
        for index, band in enumerate(self.off_resonance_hz or ()):
            if not low <= band[0] < band[1] <= high:
                raise InputError(
                    field=f"off_resonance_hz[{index}]",
                    value=list(band),
                    allowed=f"a band within {low:g} to {high:g} Hz",
                )
        return self

    @property
    def sweep_s(self) -> float:
        """Duration of one sweep, s."""
        if self.rate_hz_per_s is not None:
            return abs(self.stop_hz - self.start_hz) / self.rate_hz_per_s
        return abs(math.log2(self.stop_hz / self.start_hz)) / ((self.rate_octaves_per_min or math.inf) / 60.0)

    @property
    def _sweep(self) -> Excitation:
        way = 1.0 if self.stop_hz > self.start_hz else -1.0
        if self.rate_hz_per_s is not None:
            return Excitation(self.stop_hz, way * self.rate_hz_per_s)
        return Excitation(self.stop_hz, way * (self.rate_octaves_per_min or 0.0) / 60.0, logarithmic=True)

    def targets(self) -> tuple[Target, ...]:
        """Return one sweep per level."""
        up = self.stop_hz > self.start_hz
        return tuple(
            Target(number=number, level=level, direction="up" if up else "down")
            for number, level in enumerate(self.levels)
        )

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments of all sweeps except those in ``done``. Each sweep begins from rest."""
        start, stop = Excitation(self.start_hz), Excitation(self.stop_hz)
        volts = AmplitudeLaw.VOLTAGE
        out: list[Segment] = []
        for target in self.targets():
            if target.number in done:
                continue
            number, level = target.number, target.level
            out.append(Segment(SegmentKind.RAMP, number, 0.0, 1.0, excitation=start, amplitude_law=volts))
            out += self.start_segments(excitation=start)
            out.append(Segment(SegmentKind.RAMP, number, level, self.ramp_periods, excitation=start))
            out.append(Segment(SegmentKind.HOLD, number, level, self.hold_periods, excitation=start))
            out.append(Segment(SegmentKind.SWEEP, number, level, 0.0, excitation=self._sweep))
            out.append(Segment(SegmentKind.RAMP, -1, 0.0, self.ramp_periods, excitation=stop, amplitude_law=volts))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse levels and frequencies beyond the bench's limits."""
        self.check_no_harmonics("whose frequency moves away from where the loop has measured its plant")
        self.check_levels(bench, (min(self.start_hz, self.stop_hz), max(self.start_hz, self.stop_hz)))
        self.check_frequencies(bench, start_hz=self.start_hz, stop_hz=self.stop_hz)
