"""What every plan has: points to measure, the segments that measure them, and what it needs of bench and law."""

from abc import abstractmethod
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from controller import AmplitudeLaw, Law, OpenLoop
from rig.bench import Bench
from rig.configuration import Configured
from rig.errors import ConfigurationError
from rig.sequencer.segments import Segment, SettleRule

__all__ = ["Column", "OpenLoopPlan", "Plan", "Target", "TonePlan"]


class Target(Configured):
    """One point of a plan: where it is and from where it is approached."""

    number: int
    """From 0, in the order of measurement."""
    level: float
    """Level in V or N, after the plan's amplitude law."""
    direction: Literal["up", "down"] = "up"
    """Whether the level or frequency before was lower or higher; matters where the specimen remembers."""
    repeat: int = 1
    """Number of the pass, from 1."""
    frequency_hz: float | None = None
    """Frequency, where the plan gives it."""
    realisation: int | None = None
    """Number of a multisine's realisation, from 0."""


class Column(NamedTuple):
    """A quantity of a point as it is shown: key in the point, heading, unit, format, and what it is multiplied with.

    ``plain``: in a line of its own unit's company it needs no name.
    """

    key: str
    heading: str
    unit: str
    pattern: str
    scale: float = 1.0
    plain: bool = False


class Plan(Configured):
    """Base of all plans."""

    kind: str
    """Kind of campaign."""
    description: str = ""
    """What the plan is for."""
    bench: str = Field(min_length=1)
    """Name of a shipped bench or a TOML file."""

    @property
    def level_unit(self) -> str:
        """Unit of the targets' levels."""
        return "V"

    @property
    def amplitude_law(self) -> AmplitudeLaw:
        """What the segments' levels are."""
        return AmplitudeLaw.VOLTAGE

    @property
    @abstractmethod
    def law(self) -> Law:
        """The control law."""

    @property
    def settle_rule(self) -> SettleRule:
        """When a point counts as settled."""
        return SettleRule()

    @abstractmethod
    def targets(self) -> tuple[Target, ...]:
        """All points in the order of measurement."""

    @abstractmethod
    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """The segments that measure all points but those ``done`` already."""

    def waveforms(self, sample_rate_hz: float) -> np.ndarray | None:
        """Waveforms of unit peak that the segments play, float64[n, period]; None where they play none."""
        return None

    @abstractmethod
    def check(self, bench: Bench) -> None:
        """Raise `ConfigurationError`, before anything moves, for what the bench cannot do."""


class OpenLoopPlan(Plan):
    """Base of the plans without feedback: voltage and frequency are the plan's."""

    demodulation: OpenLoop = OpenLoop()
    """How force and response are demodulated beside the excitation, to see them settle."""

    @property
    def law(self) -> Law:
        """No feedback."""
        return self.demodulation

    def check_frequencies(self, bench: Bench, **frequencies_hz: float) -> None:
        """Refuse a frequency outside the bench's limits."""
        lowest, highest = bench.limits.frequency_hz
        for name, frequency_hz in frequencies_hz.items():
            if not lowest <= frequency_hz <= highest:
                raise ConfigurationError(
                    f"{name} = {frequency_hz:g} Hz: the bench {bench.name} allows {lowest:g} to {highest:g} Hz"
                )


class TonePlan(OpenLoopPlan):
    """Base of the plans that put out one frequency at a time."""

    levels_v: tuple[float, ...] = Field(min_length=1)
    """Amplitudes of the output voltage, V peak; every level is gone through in turn."""

    def check_levels(self, bench: Bench) -> None:
        """Refuse a level that is not positive or beyond the bench's limit."""
        for index, level in enumerate(self.levels_v):
            if not 0.0 < level <= bench.limits.voltage_v:
                raise ConfigurationError(
                    f"levels_v[{index}] = {level:g} V: the bench {bench.name} allows above 0 and up to "
                    f"{bench.limits.voltage_v:g} V"
                )
