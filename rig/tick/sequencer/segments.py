"""Settings of the settle rule, and conversion of a plan's steps to the table of segments of the compiled sequencer."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from controller import AmplitudeLaw, Law
from controller.harmonics import harmonic_ratios
from rig.bench.configuration import Configured
from rig.tick.sequencer.judgement import LONGEST_AVERAGE, SETTLE_RULE
from rig.tick.sequencer.layout import OUTCOME, SEGMENT, Drive, OnFailure, SegmentKind
from vibrolock.errors import InputError


class SettleRule(Configured):
    """When a vibration counts as settled at its set-point."""

    phase_deg: float = Field(1.0, gt=0, le=45)
    """Largest phase error, averaged over `average_periods`, deg."""
    amplitude: float = Field(0.01, gt=0, le=0.5)
    """Largest relative change of the averaged response amplitude over `average_periods`, and, with levels in newtons,
    largest relative error of the averaged force."""
    average_periods: int = Field(10, ge=1, le=LONGEST_AVERAGE)
    """Periods that are averaged."""
    settled_periods: int = Field(20, ge=1, le=10000)
    """Periods in a row that must keep the rule."""
    longest_periods: float = Field(600.0, gt=0, le=1e6)
    """Periods after which a point that has not settled is given up."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.longest_periods < self.shortest_periods:
            raise InputError(
                field="longest_periods",
                value=self.longest_periods,
                allowed=f"from {self.shortest_periods}, which two averages and the settled periods take at the least",
            )
        return self

    @property
    def shortest_periods(self) -> int:
        """Whole periods until a point can have settled."""
        return 2 * self.average_periods + self.settled_periods - 1

    def build(self) -> np.ndarray:
        """Return the record that the kernels read."""
        out = np.zeros(1, SETTLE_RULE)
        out["phase_rad"] = math.radians(self.phase_deg)
        out["amplitude"] = self.amplitude
        out["average_periods"] = self.average_periods
        out["settled_periods"] = self.settled_periods
        return out


@dataclass(frozen=True)
class Excitation:
    """Output of a segment whose frequency is not chosen by the loop.

    Without ``waveform``: a tone that ends at ``frequency_hz``; a sweep goes there at ``rate``, in Hz/s, or in octaves/s if
    ``logarithmic``. With ``waveform``: the waveform of this number, whose fundamental is ``frequency_hz``.
    """

    frequency_hz: float
    rate: float = 0.0
    logarithmic: bool = False
    waveform: int | None = None


@dataclass(frozen=True)
class Segment:
    """One step of a plan: its kind, the point it belongs to (-1: none), the level (V, N or m) and its length in periods.

    Without an ``excitation`` the phase-locked loop chooses the frequency for the lag ``lag_deg`` (by default the law's).
    ``amplitude_law`` says what the level prescribes (by default as in the plan). If the amplitude law changes, the level starts
    at the measured value, without a bump. A ``geometric`` ramp interpolates the logarithm of the level. A held segment with
    ``duration_s`` ignores its ``periods``; a sweep also ignores them and ends at its last frequency. ``harmonics`` are those
    that the harmonics loop makes, as amplitude relative to the fundamental and phase in deg (by default the law's).
    """

    kind: SegmentKind
    point: int
    level: float
    periods: float
    on_failure: OnFailure = OnFailure.SKIP
    on_lost_lock: OnFailure = OnFailure.STOP
    excitation: Excitation | None = None
    amplitude_law: AmplitudeLaw | None = None
    lag_deg: float | None = None
    geometric: bool = False
    duration_s: float | None = None
    harmonics: Mapping[int, tuple[float, float]] | None = None


def highest_frequency_hz(law: Law, segments: Sequence[Segment]) -> float:
    """Return the highest frequency of a run, Hz: of the law's window and of the tones that segments give."""
    tones = (segment.excitation.frequency_hz for segment in segments if segment.excitation is not None)
    return max((law.highest_frequency_hz, *tones))


def segment_table(
    segments: Sequence[Segment],
    sample_rate_hz: float,
    amplitude_law: AmplitudeLaw = AmplitudeLaw.VOLTAGE,
    lag_rad: float = -0.5 * math.pi,
    harmonics: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the table of segments and the matching table of outcomes, all pending.

    ``amplitude_law``, ``lag_rad`` and ``harmonics`` (complex ratios by number) apply to segments that do not give their own.
    """
    table = np.zeros(len(segments), SEGMENT)
    for index, (row, segment) in enumerate(zip(table, segments, strict=True)):
        row["kind"], row["point"], row["level"] = segment.kind, segment.point, segment.level
        row["periods"] = segment.periods
        row["samples"] = 0 if segment.duration_s is None else max(1, round(segment.duration_s * sample_rate_hz))
        row["amplitude_law"] = amplitude_law if segment.amplitude_law is None else segment.amplitude_law
        row["lag_rad"] = lag_rad if segment.lag_deg is None else math.radians(segment.lag_deg)
        row["geometric"] = segment.geometric
        row["again"] = _again(segments, index) if segment.kind is SegmentKind.RECORD else -1
        row["on_failure"], row["on_lost_lock"] = segment.on_failure, segment.on_lost_lock
        row["harmonics"] = harmonics if segment.harmonics is None else harmonic_ratios(segment.harmonics)
        if segment.kind is SegmentKind.RELEASE:
            row["drive"], row["amplitude_law"], row["level"] = Drive.SILENT, AmplitudeLaw.VOLTAGE, 0.0
        elif segment.excitation is not None:
            excitation = segment.excitation
            row["drive"] = Drive.TONE if excitation.waveform is None else Drive.WAVEFORM
            row["waveform"] = excitation.waveform or 0
            row["omega"] = 2.0 * math.pi * excitation.frequency_hz
            row["logarithmic"] = excitation.logarithmic
            unit = math.log(2.0) if excitation.logarithmic else 2.0 * math.pi
            row["rate"] = unit * excitation.rate / sample_rate_hz
    outcomes = np.zeros(len(segments), OUTCOME)
    outcomes["mean_error_rad"] = np.nan
    outcomes["drift"] = np.nan
    return table, outcomes


def _again(segments: Sequence[Segment], index: int) -> int:
    """Return the segment from which a record is measured again: the first one behind the ramp that leads to its level."""
    record = segments[index]
    while index > 0:
        before = segments[index - 1]
        if before.point != record.point or before.kind not in (SegmentKind.SETTLE, SegmentKind.HOLD):
            break
        index -= 1
    return index
