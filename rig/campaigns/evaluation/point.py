"""A point of a recording: its place in the plan, whether it is used, and its results.

`Point` holds the fields that points of all kinds of campaigns have. Results that several kinds share are in separate parts:
`Vibration`, `Modal`, `Lock`. Results of one kind alone are in `Point.result`, a class defined beside the plan of that kind.
`rig.campaigns.evaluation.stored_point` writes and reads the JSON form.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from rig.campaigns.planning.plan import Plan, Target
from rig.errors import RecordingError

PART = {"stored": "part"}
"""Metadata of a field that is a dataclass whose fields are stored among the keys of the point."""
PAIRS = {"stored": "pairs"}
"""Metadata of a complex array, stored as pairs of real and imaginary part."""
ARRAY = {"stored": "array"}
"""Metadata of an array of numbers."""


class Quality(StrEnum):
    """Quality of a point. Files, tables, messages and figures use the same words. Only the first two count as accepted."""

    GOOD = "good"
    """Accepted without warnings."""
    WARNED = "warned"
    """Accepted, with warnings."""
    REJECTED = "rejected"
    """Recorded, but beyond what the plan accepts."""
    IMPLAUSIBLE = "implausible"
    """Recorded, but a channel does not fit the others."""
    NOT_SETTLED = "not-settled"
    """Not recorded: the vibration did not settle in time."""
    DISTURBED = "disturbed"
    """The settle rule was broken while recording."""
    LOST_LOCK = "lost-lock"
    """The phase lock was lost."""
    TOO_STEEP = "too-steep"
    """The backbone became steeper than the gains bear."""
    NEAR_LIMIT = "near-limit"
    """Force or motion came near a limit of the bench."""
    NOT_LOCKED = "not-locked"
    """No phase lock was reached."""
    UNREACHABLE = "unreachable"
    """The output stood at its voltage limit."""
    OUTSIDE_WINDOW = "outside-window"
    """The frequency stood at an end of its window."""
    INTERRUPTED = "interrupted"
    """The run ended before the point did."""

    @property
    def accepted(self) -> bool:
        """Whether a point of this quality is used."""
        return self in (Quality.GOOD, Quality.WARNED)

    @classmethod
    def of(cls, reason: str) -> "Quality":
        """Return the quality of a recorded point: good if ``reason``, the reason not to accept it, is empty."""
        return cls.REJECTED if reason else cls.GOOD


@dataclass(frozen=True, kw_only=True)
class RowRange:
    """Rows of a part that belong to a point."""

    first_sample: int
    """Number of the first row in the part."""
    end_sample: int
    """Number of the row after the last row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """Harmonics of all channels over the record. Summaries omit them; they remain in the file."""

    harmonics: NDArray[np.complex128] = field(metadata=PAIRS)
    """complex128[channel, h], h from 0: peak, ``y = Re sum_h Y_h exp(i h theta)``, SI."""
    harmonics_std: NDArray[np.float64] | None = field(metadata=ARRAY)
    """float64[channel, h]: standard errors."""
    residual_rms: NDArray[np.float64] = field(metadata=ARRAY)
    """float64[channel]: RMS of the signal after the harmonics are subtracted."""
    drift: NDArray[np.complex128] | None = field(metadata=PAIRS)
    """complex128[channel]: relative change of the fundamental over the record; None if the vibration was not steady."""
    rounding_std: NDArray[np.complex128] | None = field(default=None, metadata=PAIRS)
    """complex128[channel, h]: the part of the standard errors that is due to the steps of the converter and to known images of
    the held output, in phase with the harmonic and in quadrature; None if it was not computed."""


@dataclass(frozen=True, kw_only=True)
class Purity:
    """Purity of a vibration; NaN where there is no force or no motion."""

    force_purity: float
    """Fundamental of the force over the root of the sum of squares of its harmonics; 1 for a pure force."""
    response_purity: float
    """Fundamental of the drive point's displacement over the root of the sum of squares of its harmonics; 1 if pure."""
    power_indicator: float | None
    """Active over apparent power; 1 if the force is in phase with the velocity. None in files of earlier versions."""
    harmonic_power: float | None
    """Power of all higher harmonics over power of the fundamental. None in files of earlier versions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Vibration:
    """The periodic vibration recorded at a point."""

    frequency_hz: float
    """Frequency, Hz."""
    force_n: float
    """Peak of the force's fundamental, N. For a slow-flow point: the force that would hold the vibration at phase resonance."""
    amplitude_m: float
    """Peak of the fundamental of the drive point's displacement, m."""
    voltage_v: float
    """Mean amplitude of the output, V."""
    purity: Purity = field(metadata=PART)
    """Purity of force, motion and power."""
    periods: int
    """Number of periods evaluated."""
    spectrum: Spectrum | None = field(default=None, metadata=PART)
    """Harmonics of all channels; None in a summary."""


@dataclass(frozen=True, kw_only=True)
class Modal:
    """Modal properties of the vibration."""

    modal_frequency_hz: float
    """Frequency at exact phase resonance, corrected for the remaining phase error, Hz."""
    damping_ratio: float | None
    """Modal damping ratio; None if neither plan nor bench has a mode shape of the drive point."""
    modal_frequency_std_hz: float | None = None
    """Standard error of the modal frequency, Hz."""
    damping_ratio_std: float | None = None
    """Standard error of the damping ratio, that of a measured mode shape included; None if unknown."""
    drive_mode_shape: float | None = None
    """Mode shape at the drive point, of the plan's ``[plant]``, that the damping was computed with, kg^-1/2; None if it was the
    bench's."""
    drive_mode_shape_std: float | None = None
    """Standard error of this mode shape; None if unknown."""


@dataclass(frozen=True, kw_only=True)
class Lock:
    """How accurately a phase lag was held."""

    phase_error_deg: float | None
    """Wanted minus measured lag of the fundamental, deg."""
    phase_scatter_deg: float | None = None
    """Standard deviation of the lag while the point was recorded, deg."""
    frequency_scatter: float | None = None
    """Relative standard deviation of the frequency from period to period."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """An earlier attempt at a point, which was refused for something that passes."""

    reason: str
    """Why it was refused."""
    quality: Quality
    """Its quality."""
    rows: RowRange | None = field(default=None, metadata=PART)
    """Its rows, in its part of the recording; None if not all of them were recorded."""
    part: int | None = None
    """Number of its part of the recording, from 0; None if it is the part of the point."""
    frequency_hz: float | None = None
    """Frequency of the output, Hz; None if there was no single one."""
    force_n: float | None = None
    """Peak of the force's fundamental, N; None if it is not known."""


Result = TypeVar("Result", covariant=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Point(Generic[Result]):
    """A point that was measured, failed or was interrupted.

    The stored form omits a field that has a default while it has its default value. All other fields are always stored.
    """

    number: int
    """Permanent number in the recording, from 0. People see `point_name`, which counts from 1."""
    level: float
    """Level in the unit of the plan."""
    level_unit: str
    """Unit of the level: V, V RMS, N, N RMS or m."""
    direction: Literal["up", "down", "both"]
    """Side from which the level or frequency was approached; ``both`` for the mean of two ways."""
    repeat: int
    """Number of the pass, from 1."""
    asked_frequency_hz: float | None = None
    """Frequency that the plan asks for, Hz."""
    asked_phase_lag_deg: float | None = None
    """Lag that the plan asks for, of the drive-point acceleration behind the force, deg."""
    asked_harmonics: tuple[tuple[int, float, float], ...] | None = None
    """Harmonics of the force that the plan asks for at this point: number, amplitude relative to the fundamental, phase in
    deg."""
    realisation: int | None = None
    """Number of a multisine's realisation, from 0."""
    repeats_first: bool = False
    """Whether this is the repetition of the first point at the end of the run. It enters no result."""
    settled: bool | None
    """Whether the vibration settled; None if settling was not required."""
    reason: str
    """Why the point is not accepted; empty if it is accepted."""
    quality: Quality
    """Quality of the point."""
    warnings: tuple[str, ...] | None = None
    """Warnings for the user, one line each; None if nothing was evaluated. Beside a point stands what is before the first
    colon."""
    notes: tuple[str, ...] = ()
    """Remarks in the form of warnings that do not concern what the test asks for."""
    settle_periods: float | None = None
    """Periods from the end of the ramp until the vibration settled or the point failed."""
    amplitude_drift: float | None = None
    """Last relative drift of the amplitude that the settle rule computed."""
    nonharmonic_force: float | None = None
    """Part of the force's RMS that is neither a harmonic nor noise; NaN if the record is too short to determine it."""
    channel_rms: tuple[float, ...] | None = None
    """RMS of every channel without its mean, if no single frequency was evaluated."""
    lost_samples: int | None = None
    """Number of samples lost in transfer; None if nothing was recorded."""
    continued_samples: int | None = None
    """Number of samples at which the device went on by itself with the vibration; None if nothing was recorded."""
    misfit: float | None = None
    """Largest factor by which a channel does not fit the others; None if there was nothing to compare with."""
    misfit_channels: tuple[str, ...] = ()
    """Names of the channels that do not fit."""
    rows: RowRange | None = field(default=None, metadata=PART)
    """Rows of the point; None if no rows or not all of them were recorded."""
    vibration: Vibration | None = field(default=None, metadata=PART)
    """The vibration that was recorded."""
    modal: Modal | None = field(default=None, metadata=PART)
    """Modal properties of the vibration."""
    lock: Lock | None = field(default=None, metadata=PART)
    """How accurately the phase was held."""
    result: Result | None = field(default=None, metadata=PART)
    """Results that only this kind of campaign has."""
    refused_before: tuple[Attempt, ...] = ()
    """Earlier attempts at the point in the same run, in their order. This one was made because they were refused."""
    part: int | None = None
    """Number of the part of the recording that contains the point, from 0; None before it is recorded."""

    @property
    def accepted(self) -> bool:
        """Whether the point is used."""
        return self.quality.accepted

    @property
    def evaluated(self) -> bool:
        """Whether the rows of the point gave a result."""
        return self.vibration is not None or self.channel_rms is not None

    @property
    def attempts(self) -> int:
        """How often the point was measured in this run."""
        return 1 + len(self.refused_before)

    @property
    def spectrum(self) -> Spectrum | None:
        """Harmonics of the vibration; None if there are none."""
        return None if self.vibration is None else self.vibration.spectrum

    def refused(self, reason: str, quality: Quality = Quality.REJECTED) -> "Point[Result]":
        """Return the same point, not accepted."""
        return replace(self, reason=reason, quality=quality)

    def warned(self, *texts: str) -> "Point[Result]":
        """Return the same point with further warnings."""
        return replace(self, warnings=(*(self.warnings or ()), *texts))


def planned_point(plan: Plan, target: Target) -> Point[object]:
    """Return a point as the plan asks for it, before anything is measured."""
    return Point(
        number=target.number,
        level=target.level,
        level_unit=plan.level_unit,
        direction=target.direction,
        repeat=target.repeat,
        asked_frequency_hz=target.frequency_hz,
        asked_phase_lag_deg=target.phase_lag_deg,
        asked_harmonics=None
        if target.harmonics is None
        else tuple((order, *wanted) for order, wanted in sorted(target.harmonics.items())),
        realisation=target.realisation,
        repeats_first=target.repeats_first,
        settled=None,
        reason="",
        quality=Quality.GOOD,
    )


def point_name(number: int) -> str:
    """Return the name of a point as people read it: its number in the recording, counted from 1."""
    return f"point {number + 1}"


def vibration_of(point: Point[object]) -> Vibration:
    """Return the vibration of a point that must have one; raise `RecordingError` if it has none."""
    if point.vibration is None:
        raise RecordingError(f"{point_name(point.number)}: holds no vibration")
    return point.vibration


def spectrum_of(point: Point[object]) -> Spectrum:
    """Return the harmonics of a point that must have some; raise `RecordingError` if it has none."""
    if point.spectrum is None:
        raise RecordingError(f"{point_name(point.number)}: holds no harmonics")
    return point.spectrum


def result_of(point: Point[Result]) -> Result:
    """Return the results that only this kind of campaign has; raise `RecordingError` if the point has none."""
    if point.result is None:
        raise RecordingError(f"{point_name(point.number)}: holds no result")
    return point.result
