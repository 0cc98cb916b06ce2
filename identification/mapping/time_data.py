"""Mappings of time data: what a file of somebody else holds, and which records it makes."""

from pathlib import PureWindowsPath
from typing import Annotated, Literal

from pydantic import Field, model_validator

from identification.mapping.base import MappingTable, MeasurementMapping, NotNegative, Path, Positive, check_names
from identification.mapping.sampling import SignalMapping, TimeUnit
from vibrolock.errors import InputError

Axis = Literal["sample", "channel", "period", "realisation", "level"]
Encoding = Literal[
    "utf-8", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1250", "cp1251", "cp1252", "cp437", "cp850", "mac-roman",
    "shift-jis", "gb18030", "euc-kr"
]  # fmt: skip
Count = Annotated[int, Field(ge=0)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class CsvLayout(MappingTable):
    """How a table of numbers is written in a CSV file that does not begin with one line of names."""

    skip_lines: Count = 0
    """Lines at the beginning that are no part of the table; empty lines and comments (``#``) do not count."""
    skip_last_lines: Count = 0
    """Lines at the end that are no part of the table, such as largest and mean values."""
    names: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Names of the columns; if left out, they are in the first line that is not skipped."""
    separator: Literal[",", ";", "\t", " "] | None = None
    """What separates columns (a space: any number of them); if left out, comma, semicolon or tab, whichever is commonest."""
    decimal: Literal[".", ","] = "."
    """Decimal point or comma."""
    encoding: Encoding | None = None
    """Encoding of the text; if left out, UTF-16 by its mark or its zeros, UTF-8 if it is that, else that of Windows."""


class SampledChannel(SignalMapping):
    """A channel, where its samples are, and what their numbers mean."""

    value: Path
    """Path of the samples."""
    file: str = ""
    """File with the samples, beside the one that is imported; if left out, in that one."""
    axes: Annotated[tuple[Axis, ...], Field(min_length=1)] | None = None
    """Dimensions of the array, as the key ``axes`` of the mapping, for this channel alone."""
    index: Annotated[int, Field(ge=1)] = 1
    """Number of the channel along the axis ``channel``, from 1."""
    scale: Finite = 1.0
    """Factor from stored numbers to ``unit``, such as the inverse of a sensitivity; negative for an inverted sensor."""
    offset: Finite | Literal["mean"] = 0.0
    """What is subtracted from the stored numbers; ``mean`` for the mean of each record."""
    start_samples: Count = 0
    """Number of samples at the beginning that are left out, for a channel that began earlier than others."""

    @model_validator(mode="after")
    def _moves(self) -> "SampledChannel":
        if self.file == ".." or PureWindowsPath(self.file).name != self.file:  # no separator and drive of any system
            raise ValueError(
                f"file = {self.file!r} of channel '{self.name}': allowed is the name of a file beside the one that is imported"
            )
        if self.scale == 0.0:
            raise ValueError(f"scale = 0 of channel '{self.name}': allowed is any number but 0")
        if self.axes is not None:
            check_axes(self.axes)
        return self


class Stretch(MappingTable):
    """A stretch of a long record that becomes a record of its own, or several of equal length that follow each other."""

    start_samples: Count | None = None
    """Number of samples before it."""
    start_s: NotNegative | None = None
    """Time before it; in place of ``start_samples``."""
    samples: Annotated[int, Field(ge=2)] | None = None
    """Number of samples; to the end if left out."""
    duration_s: Positive | None = None
    """Duration; in place of ``samples``."""
    repeat: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of stretches of this length."""
    step_samples: Annotated[int, Field(ge=1)] | None = None
    """Samples from the beginning of one to that of the next; if left out, they follow each other without a gap."""
    level: Finite | None = None
    """Level of its records; if left out, the RMS of the force."""

    @model_validator(mode="after")
    def _either(self) -> "Stretch":
        for one, other in (("start_samples", "start_s"), ("samples", "duration_s")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise ValueError(f"{one} and {other}: give one of the two")
        if self.repeat > 1 and self.samples is None and self.duration_s is None:
            raise InputError(field="repeat", allowed="samples or duration_s")
        return self


class TimeDataMapping(MeasurementMapping):
    """Where the samples are in the data, and which records they are."""

    kind: Literal["time-data"]
    """Kind of the mapping."""
    sample_rate_hz: Positive | None = None
    """Samples per second; if left out, taken from ``time`` or from the file."""
    time: Path | None = None
    """Path of the instants."""
    time_unit: TimeUnit = ""
    """Unit of the instants, such as ``ms``; if left out, the file's, or else seconds."""
    records: Path | None = None
    """Path of a list with one structure per record; the other paths are relative to these structures."""
    axes: Annotated[tuple[Axis, ...], Field(min_length=1)] = ("sample", "realisation")
    """Dimensions of the arrays, in their order: ``sample``, ``channel``, ``period``, ``realisation``, ``level``. Of vectors the
    first name counts alone."""
    levels: Annotated[tuple[Finite, ...], Field(min_length=1)] | None = None
    """Levels: one number for each along the axis ``level``, or else one for each record, or one for all. Without that axis also
    one for each size of the force. If left out, the RMS of the force over the records of one level: those that are alike along
    that axis or, without it, those whose RMS differs by less than 15 % from the next."""
    stretches: tuple[Stretch, ...] = ()
    """Parts of each record; the whole if left out."""
    period_samples: Annotated[int, Field(ge=3)] | None = None
    """Number of samples in a period, as stored; left out for data that is not periodic. With the axis ``period`` it is the
    length of the axis ``sample``."""
    transient_periods: Count = 0
    """Number of periods to discard at the beginning of each record."""
    ahead_periods: NotNegative | None = None
    """Periods put ahead of each record when a model is simulated from rest, in which its transient decays; if left out,
    ``transient_periods``, at least 1."""
    at_rest: bool = False
    """Whether records that are not periodic begin at rest."""
    lowest_hz: NotNegative | None = None
    """Lowest excited frequency; left out if unknown."""
    highest_hz: Positive | None = None
    """Highest excited frequency; left out if unknown."""
    new_rate_hz: Positive | None = None
    """Lower sample rate to which the records are filtered and decimated; left out, they keep theirs."""
    instrument: str = ""
    """Name of a noise-free channel, such as the voltage of the generator, for frequency responses; the force if left out."""
    csv: CsvLayout | None = None
    """Layout of a CSV file that does not begin with one line of names."""
    channels: Annotated[tuple[SampledChannel, ...], Field(min_length=1)]
    """The channels: a force and motions, or motions alone for a free decay."""

    @model_validator(mode="after")
    def _fits(self) -> "TimeDataMapping":
        check_axes(self.axes)
        check_names(self.channels)
        names = [channel.name for channel in self.channels]
        if self.instrument and self.instrument not in names:
            raise InputError(field="instrument", value=self.instrument, allowed=names)
        if (self.lowest_hz is None) != (self.highest_hz is None):
            raise ValueError("lowest_hz and highest_hz: give both or none")
        if self.lowest_hz is not None and self.highest_hz is not None and self.lowest_hz >= self.highest_hz:
            allowed = f"below `highest_hz` = {self.highest_hz:g}"
            raise InputError(field="lowest_hz", value=self.lowest_hz, allowed=allowed)
        if self.transient_periods and not self.is_periodic:
            reason = "is for periodic data"
            raise InputError(reason, field="transient_periods", hint="add period_samples, or leave it out")
        return self

    @property
    def is_periodic(self) -> bool:
        """Whether the records are periodic."""
        return self.period_samples is not None or any("period" in self.axes_of(channel) for channel in self.channels)

    def axes_of(self, channel: SampledChannel) -> tuple[Axis, ...]:
        """Return the axes of a channel."""
        return self.axes if channel.axes is None else channel.axes


def check_axes(axes: tuple[str, ...]) -> None:
    """Raise ValueError unless ``sample`` is among the axes, and none is named twice."""
    InputError.raise_if("sample" not in axes, "sample must be among them", field="axes", value=list(axes))
    InputError.raise_if(len(set(axes)) < len(axes), "each may be named once", field="axes", value=list(axes))
