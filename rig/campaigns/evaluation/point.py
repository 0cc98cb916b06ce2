"""A point of a recording: where it stands in the plan, whether it is used, and what was measured at it.

`Point` holds what the points of all kinds of campaigns have. What several kinds measure is in parts of its own: `Vibration`,
`Modal`, `Lock`. What one kind alone measures is its `Point.result`, a class that stands beside the kind's plan.
`rig.campaigns.evaluation.stored_point` writes and reads the JSON form.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from rig.campaigns.planning.plan import Plan, Target
from rig.errors import RecordingError

__all__ = [
    "ARRAY",
    "PAIRS",
    "PART",
    "Lock",
    "Modal",
    "Point",
    "Purity",
    "Quality",
    "RowRange",
    "Spectrum",
    "Vibration",
    "planned_point",
    "point_name",
    "result_of",
    "spectrum_of",
    "vibration_of",
]

PART = {"stored": "part"}
"""Metadata of a field whose own fields are stored among the keys of the point."""
PAIRS = {"stored": "pairs"}
"""Metadata of a complex array, which is stored as pairs of real and imaginary part."""
ARRAY = {"stored": "array"}
"""Metadata of an array of numbers."""


class Quality(StrEnum):
    """What a point is worth: the same words in files, tables, messages and figures. Only the first two are accepted."""

    GOOD = "good"
    """Accepted, and there is nothing to say."""
    WARNED = "warned"
    """Accepted, with warnings."""
    REJECTED = "rejected"
    """Recorded, but beyond what the plan accepts."""
    IMPLAUSIBLE = "implausible"
    """Recorded, but a channel does not fit the others."""
    NOT_SETTLED = "not-settled"
    """Not recorded: it did not settle in time."""
    DISTURBED = "disturbed"
    """The settle rule was broken while recording."""
    LOST_LOCK = "lost-lock"
    """The phase lock was lost."""
    NOT_LOCKED = "not-locked"
    """No phase lock was gained."""
    UNREACHABLE = "unreachable"
    """The output stood at its voltage limit."""
    OUTSIDE_WINDOW = "outside-window"
    """The frequency stood at an end of its window."""
    INTERRUPTED = "interrupted"
    """The run ended before the point did."""

    @property
    def accepted(self) -> bool:
        """Whether such a point is used."""
        return self in (Quality.GOOD, Quality.WARNED)

    @classmethod
    def of(cls, reason: str) -> "Quality":
        """Quality of a point that was recorded, by the reason not to accept it, which is empty if it is accepted."""
        return cls.REJECTED if reason else cls.GOOD


@dataclass(frozen=True, kw_only=True)
class RowRange:
    """Which rows of its part belong to a point."""

    first_sample: int
    """Number of the first row in the part."""
    end_sample: int
    """Number of the row behind the last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """Harmonics of all channels over the record. Summaries leave them in the file."""

    harmonics: NDArray[np.complex128] = field(metadata=PAIRS)
    """complex128[channel, h], h from 0: peak, ``y = Re sum_h Y_h exp(i h theta)``, SI."""
    harmonics_std: NDArray[np.float64] | None = field(metadata=ARRAY)
    """float64[channel, h]: standard errors."""
    residual_rms: NDArray[np.float64] = field(metadata=ARRAY)
    """float64[channel]: RMS of what the harmonics leave of the signal."""
    drift: NDArray[np.complex128] | None = field(metadata=PAIRS)
    """complex128[channel]: relative change of the fundamental over the record; None where nothing was at rest."""


@dataclass(frozen=True, kw_only=True)
class Purity:
    """How pure a vibration is; NaN where there is no force or no motion."""

    force_purity: float
    """Fundamental of the force over the root of the sum of squares of its harmonics, 1 where it is pure."""
    response_purity: float
    """The same of the displacement of the drive point."""
    power_indicator: float | None
    """Active over apparent power, 1 where the force is in phase with the velocity. None in files of earlier versions."""
    harmonic_power: float | None
    """Power of all higher harmonics over that of the fundamental. None in files of earlier versions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Vibration:
    """A periodic vibration, as it was recorded at a point."""

    frequency_hz: float
    """Frequency, Hz."""
    force_n: float
    """Peak of the force's fundamental, N; of a short point the one that would hold it at phase resonance."""
    amplitude_m: float
    """Peak of the fundamental of the drive point's displacement, m."""
    voltage_v: float
    """Mean amplitude of the output, V."""
    purity: Purity = field(metadata=PART)
    """How pure it is."""
    periods: int
    """Periods that were evaluated."""
    spectrum: Spectrum | None = field(default=None, metadata=PART)
    """Its harmonics; None in a summary."""


@dataclass(frozen=True, kw_only=True)
class Modal:
    """Modal properties of the vibration."""

    modal_frequency_hz: float
    """Frequency without the phase error that was left, Hz."""
    damping_ratio: float | None
    """Modal damping ratio; None where the bench has no mode shape of the drive point."""
    modal_frequency_std_hz: float | None = None
    """Standard error of the modal frequency, Hz."""
    damping_ratio_std: float | None = None
    """Standard error of the damping ratio."""


@dataclass(frozen=True, kw_only=True)
class Lock:
    """How well a phase lag was held."""

    phase_error_deg: float | None
    """Wanted less measured lag of the fundamental, deg."""
    phase_scatter_deg: float | None = None
    """Standard deviation of the lag while the point was recorded, deg."""
    frequency_scatter: float | None = None
    """Standard deviation of the frequency from period to period, relative."""


Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, eq=False)
class Point(Generic[Result]):
    """A point that was measured, failed or was interrupted.

    In the stored form a field that has a default is left out while it has its default value; all others are always there.
    """

    number: int
    """Number in the recording, from 0 and for good. People see `point_name`, which counts from 1."""
    level: float
    """Level in the plan's unit."""
    level_unit: str
    """Unit of the level: V, V RMS, N, N RMS or m."""
    direction: Literal["up", "down", "both"]
    """From where the level or frequency was approached; ``both`` for the mean of two ways."""
    repeat: int
    """Number of the pass, from 1."""
    asked_frequency_hz: float | None = None
    """Frequency that the plan asks for, Hz."""
    asked_phase_lag_deg: float | None = None
    """Lag of the drive-point acceleration behind the force that the plan asks for, deg."""
    realisation: int | None = None
    """Number of a multisine's realisation, from 0."""
    repeats_first: bool = False
    """Whether it is the first point measured again at the end, which is part of no result."""
    settled: bool | None
    """Whether the vibration settled; None where that was not asked for."""
    reason: str
    """Why it is not accepted; empty if it is."""
    quality: Quality
    """What it is worth."""
    warnings: tuple[str, ...] | None = None
    """What a user should know of it, one line each; None where nothing was evaluated."""
    settle_periods: float | None = None
    """Periods from the end of the ramp until it settled or failed."""
    amplitude_drift: float | None = None
    """Last drift of the amplitude that the settle rule saw, relative."""
    alien_force: float | None = None
    """Part of the force's RMS that is neither a harmonic nor noise; NaN where the record is too short to tell."""
    channel_rms: tuple[float, ...] | None = None
    """RMS of every channel without its mean, where no single frequency was evaluated."""
    lost_samples: int | None = None
    """Samples that were lost on their way; None where nothing was recorded."""
    misfit: float | None = None
    """Largest factor by which a channel does not fit the others; None where there was nothing to compare with."""
    misfit_channels: tuple[str, ...] = ()
    """Names of the channels that do not fit."""
    rows: RowRange | None = field(default=None, metadata=PART)
    """Where its rows are; None where none were recorded, or not all of them."""
    vibration: Vibration | None = field(default=None, metadata=PART)
    """The vibration that was recorded."""
    modal: Modal | None = field(default=None, metadata=PART)
    """Its modal properties."""
    lock: Lock | None = field(default=None, metadata=PART)
    """How well its phase was held."""
    result: Result | None = field(default=None, metadata=PART)
    """What only this kind of campaign measures."""
    part: int | None = None
    """Number of the part of the recording it lies in, from 0; None before it is recorded."""

    @property
    def accepted(self) -> bool:
        """Whether it is used."""
        return self.quality.accepted

    @property
    def evaluated(self) -> bool:
        """Whether its rows told anything."""
        return self.vibration is not None or self.channel_rms is not None

    @property
    def spectrum(self) -> Spectrum | None:
        """Harmonics of its vibration; None where there is none."""
        return None if self.vibration is None else self.vibration.spectrum

    def refused(self, reason: str, quality: Quality = Quality.REJECTED) -> "Point[Result]":
        """The same point, not accepted."""
        return replace(self, reason=reason, quality=quality)

    def warned(self, *texts: str) -> "Point[Result]":
        """The same point with further warnings."""
        return replace(self, warnings=(*(self.warnings or ()), *texts))


def planned_point(plan: Plan, target: Target) -> Point[Any]:
    """A point as the plan asks for it, before anything is known of it."""
    return Point(
        number=target.number,
        level=target.level,
        level_unit=plan.level_unit,
        direction=target.direction,
        repeat=target.repeat,
        asked_frequency_hz=target.frequency_hz,
        asked_phase_lag_deg=target.phase_lag_deg,
        realisation=target.realisation,
        repeats_first=target.repeats_first,
        settled=None,
        reason="",
        quality=Quality.GOOD,
    )


def point_name(number: int) -> str:
    """What a point is called where people read it: its number in the recording, counted from 1."""
    return f"point {number + 1}"


def vibration_of(point: Point[Any]) -> Vibration:
    """The vibration of a point that must have one; `RecordingError` where it has none."""
    if point.vibration is None:
        raise RecordingError(f"{point_name(point.number)}: holds no vibration")
    return point.vibration


def spectrum_of(point: Point[Any]) -> Spectrum:
    """The harmonics of a point that must have some; `RecordingError` where it has none."""
    if point.spectrum is None:
        raise RecordingError(f"{point_name(point.number)}: holds no harmonics")
    return point.spectrum


def result_of(point: Point[Result]) -> Result:
    """What the kind of campaign has measured at a point that must have been measured; `RecordingError` where it was not."""
    if point.result is None:
        raise RecordingError(f"{point_name(point.number)}: holds no result")
    return point.result
