"""The stepped-sine campaign: step through given frequencies at a given voltage or at a held force or displacement."""

from functools import partial
from itertools import product
from typing import Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.campaigns.planning.levels import ONE_LEVEL_KEY, exactly_one
from rig.campaigns.planning.plan import Target, TonePlan
from rig.tick.sequencer.layout import OnFailure, SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment, SettleRule
from vibrolock.errors import InputError


class SteppedSinePlan(TonePlan):
    """Vibrations at given frequencies and levels. With a single frequency this is a sine test.

    Every point is approached by a half-cosine ramp of frequency and level, settled by the amplitudes of force and response as
    in ``settle``, and recorded over whole periods. If two stable responses exist at one frequency and voltage or force, the
    direction decides which of them is found; the unstable one is never found. At a held displacement there is one force at
    every frequency.
    """

    model_config = ConfigDict(
        json_schema_extra={"allOf": [ONE_LEVEL_KEY, exactly_one(("frequencies_hz",), ("start_hz", "stop_hz"))]}
    )

    kind: Literal["stepped-sine"] = "stepped-sine"
    """Kind of campaign."""
    frequencies_hz: tuple[float, ...] | None = None
    """Frequencies, in the order of measurement, Hz. Give either these or ``start_hz`` and ``stop_hz``."""
    start_hz: float | None = Field(None, gt=0)
    """First frequency, instead of ``frequencies_hz``, Hz."""
    stop_hz: float | None = Field(None, gt=0)
    """Last frequency, Hz; below ``start_hz`` to step down."""
    steps: int = Field(50, ge=2, le=100_000)
    """Number of frequencies from the first to the last."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """Spacing of the frequencies."""
    ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp from one point to the next, periods."""
    record_periods: int = Field(20, ge=4, le=1_000_000)
    """Periods recorded and evaluated at each point."""
    harmonics: int = Field(7, ge=1, le=50)
    """Highest harmonic evaluated."""
    settle: SettleRule = SettleRule(settled_periods=10)
    """When a point counts as settled. The rule's phase error is not used."""
    accepted_drift: float = Field(0.05, gt=0, le=1)
    """Largest relative change of the fundamental of force or drive over a record with which a point is accepted."""
    accepted_level_error: float = Field(0.01, gt=0, le=1)
    """Largest relative deviation of a recorded force or displacement from its level with which a point is accepted. It is not
    used with levels in volts."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows a point that does not settle or is disturbed: ``skip`` goes on with the next point, ``stop`` ramps down."""

    @model_validator(mode="after")
    def _frequencies_make_sense(self) -> Self:
        if (self.frequencies_hz is None) == (self.start_hz is None) or (self.start_hz is None) != (
            self.stop_hz is None
        ):
            raise InputError("exactly one of this and of start_hz with stop_hz must be given", field="frequencies_hz")
        for index, frequency_hz in enumerate(self.frequencies_hz or ()):
            InputError.unless_above(f"frequencies_hz[{index}]", frequency_hz, 0)
        if not self.frequencies_at_each_level:
            raise InputError("at least one frequency is needed", field="frequencies_hz", value=[])
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels and frequencies."""
        if self.frequencies_hz is not None:
            return {**super().counts, "frequencies_hz": len(self.frequencies_hz)}
        return {**super().counts, "steps": self.steps}

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
        """Return all points: every frequency at the first level, then at the next level, and so on."""
        frequencies = self.frequencies_at_each_level
        up = len(frequencies) < 2 or frequencies[1] >= frequencies[0]
        return tuple(
            Target(number=number, level=level, direction="up" if up else "down", frequency_hz=frequency_hz)
            for number, (level, frequency_hz) in enumerate(product(self.levels, frequencies))
        )

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``.

        A new level starts from rest at its first frequency. Points that are done are passed through on the way to the remaining
        points of their level: if two responses exist, the path decides which one is found.
        """
        targets = self.targets()
        last_of_level = {target.level: target.number for target in targets if target.number not in done}
        out: list[Segment] = []
        before: Target | None = None
        for target in targets:
            if target.number > last_of_level.get(target.level, -1):
                continue
            tone = Excitation(target.frequency_hz or 0.0)
            number = -1 if target.number in done else target.number
            if before is not None and before.level != target.level:
                rest = partial(Segment, SegmentKind.RAMP, level=0.0, amplitude_law=AmplitudeLaw.VOLTAGE)
                out.append(rest(point=-1, periods=self.ramp_periods, excitation=out[-1].excitation))
                out.append(rest(point=number, periods=1.0, excitation=tone))
            if before is None or before.level != target.level:
                out += self.start_segments(excitation=tone)
            out += self._at(target, number, tone)
            before = target
        return tuple(out)

    def _at(self, target: Target, number: int, tone: Excitation) -> list[Segment]:
        at = partial(Segment, point=number, level=target.level, excitation=tone)
        ramp = at(
            kind=SegmentKind.RAMP, periods=self.ramp_periods, geometric=self.amplitude_law is AmplitudeLaw.RESPONSE
        )
        if number < 0:
            return [ramp]
        failure = OnFailure[self.on_failure.upper()]
        settle = at(kind=SegmentKind.SETTLE, periods=self.settle.longest_periods, on_failure=failure)
        record = at(kind=SegmentKind.RECORD, periods=self.record_periods + 1.0, on_failure=failure)
        return [ramp, settle, record]

    def check(self, bench: Bench) -> None:
        """Refuse levels and frequencies beyond the bench's limits."""
        frequencies = self.frequencies_at_each_level
        self.check_levels(bench, (min(frequencies), max(frequencies)))
        self.check_frequencies(bench, **{"lowest frequency": min(frequencies), "highest frequency": max(frequencies)})
        self.check_evaluated(self.harmonics, bench, max(frequencies), spare=1)
