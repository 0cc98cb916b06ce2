"""The stepped-sine campaign in open loop: voltage and frequency given, step by step, settle, record whole periods."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rig.bench import Bench
from rig.campaigns.plan import Target, TonePlan
from rig.errors import ConfigurationError
from rig.sequencer.layout import OnFailure, SegmentKind
from rig.sequencer.segments import Excitation, Segment, SettleRule

__all__ = ["SteppedSinePlan"]


class SteppedSinePlan(TonePlan):
    """Vibrations at given voltages and frequencies; a single frequency makes it a sine test.

    Every point is approached by a half-cosine ramp of frequency and level, settled by the amplitudes of force and response in
    ``settle``, and recorded over whole periods. Where two responses exist at one frequency, the direction decides which
    is found; the unstable one never is.
    """

    kind: Literal["stepped-sine"] = "stepped-sine"
    """Kind of campaign."""
    frequencies_hz: tuple[float, ...] | None = None
    """Frequencies, in the order of measurement, Hz."""
    start_hz: float | None = Field(None, gt=0)
    """First frequency, in place of ``frequencies_hz``, Hz."""
    stop_hz: float | None = Field(None, gt=0)
    """Last frequency, Hz; below ``start_hz`` to step down."""
    steps: int = Field(50, ge=2, le=100_000)
    """Number of frequencies from the first to the last."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """How they are spaced."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp from one point to the next, periods."""
    record_periods: int = Field(20, ge=4, le=1_000_000)
    """Periods that are recorded and evaluated at each point."""
    harmonics: int = Field(7, ge=1, le=50)
    """Highest harmonic that is evaluated."""
    settle: SettleRule = SettleRule(settled_periods=10)
    """When a point counts as settled; its phase error is not asked for."""
    accepted_drift: float = Field(0.05, gt=0, le=1)
    """Largest change of the fundamental of force or drive over a record, relative, with which a point is accepted."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows when a point does not settle or is disturbed: the next point, or a ramp-down."""

    @model_validator(mode="after")
    def _frequencies_make_sense(self) -> Self:
        if (self.frequencies_hz is None) == (self.start_hz is None) or (self.start_hz is None) != (
            self.stop_hz is None
        ):
            raise ValueError("frequencies_hz: exactly one of it and of start_hz with stop_hz is to be given")
        for index, frequency_hz in enumerate(self.frequencies_hz or ()):
            if not frequency_hz > 0.0:
                raise ValueError(f"frequencies_hz[{index}] = {frequency_hz:g}: allowed is above 0")
        if not self.frequencies_at_each_level:
            raise ValueError("frequencies_hz = []: at least one frequency is needed")
        return self

    @property
    def frequencies_at_each_level(self) -> tuple[float, ...]:
        """All frequencies in the order of measurement, Hz."""
        if self.start_hz is None or self.stop_hz is None:
            return self.frequencies_hz or ()
        spaced = np.linspace if self.spacing == "linear" else np.geomspace
        return tuple(float(f) for f in spaced(self.start_hz, self.stop_hz, self.steps))

    @property
    def settle_rule(self) -> SettleRule:
        """When a point counts as settled."""
        return self.settle

    def targets(self) -> tuple[Target, ...]:
        """All points: every frequency at the first level, then at the next."""
        frequencies = self.frequencies_at_each_level
        up = len(frequencies) < 2 or frequencies[1] >= frequencies[0]
        return tuple(
            Target(number=number, level=level, direction="up" if up else "down", frequency_hz=frequency_hz)
            for number, (level, frequency_hz) in enumerate((v, f) for v in self.levels for f in frequencies)
        )

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """The segments that measure all points but those ``done``; a new level begins from rest at its first frequency.

        Points that are done are passed through on the way to the others of their level: where two responses exist, the way
        decides which is found.
        """
        failure = OnFailure[self.on_failure.upper()]
        targets = self.targets()
        last_of_level = {target.level: target.number for target in targets if target.number not in done}
        out: list[Segment] = []
        before: Target | None = None
        for target in targets:
            if target.number > last_of_level.get(target.level, -1):
                continue
            tone = Excitation(target.frequency_hz or 0.0)
            number, level = -1 if target.number in done else target.number, target.level
            if before is not None and before.level != level:
                out.append(Segment(SegmentKind.RAMP, -1, 0.0, self.ramp_periods, excitation=out[-1].excitation))
                out.append(Segment(SegmentKind.RAMP, number, 0.0, 1.0, excitation=tone))
            out.append(Segment(SegmentKind.RAMP, number, level, self.ramp_periods, excitation=tone))
            before = target
            if target.number in done:
                continue
            longest = self.settle.longest_periods
            out.append(Segment(SegmentKind.SETTLE, number, level, longest, failure, excitation=tone))
            periods = self.record_periods + 1.0
            out.append(Segment(SegmentKind.RECORD, number, level, periods, failure, excitation=tone))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse levels and frequencies beyond the bench's limits."""
        self.check_levels(bench)
        frequencies = self.frequencies_at_each_level
        self.check_frequencies(bench, **{"lowest frequency": min(frequencies), "highest frequency": max(frequencies)})
        highest = int(bench.sample_rate_hz / max(frequencies) / 2.0) - 1
        if self.harmonics > highest:
            raise ConfigurationError(
                f"harmonics = {self.harmonics}: allowed is up to {highest} at {bench.sample_rate_hz:g} samples/s and "
                f"{max(frequencies):g} Hz"
            )
