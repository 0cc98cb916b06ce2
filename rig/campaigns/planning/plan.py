"""What every plan has: points to measure, the segments that measure them, and what it needs of bench and law."""

import math
from abc import abstractmethod
from typing import Literal, NamedTuple, Self

import numpy as np
from pydantic import AliasChoices, Field, model_validator

from controller import AmplitudeLaw, Law, OpenLoop
from controller.tuning import PlantModel
from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.campaigns.planning.levels import Levels
from rig.errors import ConfigurationError
from rig.tick.sequencer.segments import Segment, SettleRule

__all__ = ["MOST_POINTS", "Column", "OpenLoopPlan", "Plan", "Target", "TonePlan", "with_first_repeated"]

MOST_POINTS = 10_000
"""Of a plan, repeats and both directions counted: at ten seconds a point more than a day.
See `rig.campaigns.planning.lengths`, too."""


class Target(Configured):
    """One point of a plan: where it is and from where it is approached."""

    number: int
    """From 0, in the order of measurement."""
    level: float
    """Level in the plan's unit: V, N or m."""
    direction: Literal["up", "down"] = "up"
    """Whether the level or frequency before was lower or higher; matters where the specimen remembers."""
    repeat: int = 1
    """Number of the pass, from 1."""
    frequency_hz: float | None = None
    """Frequency, where the plan gives it."""
    phase_lag_deg: float | None = None
    """Wanted lag of the drive-point acceleration behind the force, where the plan gives it, deg."""
    realisation: int | None = None
    """Number of a multisine's realisation, from 0."""
    repeats_first: bool = False
    """Whether it is the plan's first point measured again at its end, to see a drift; it is part of no result."""


def with_first_repeated(targets: tuple[Target, ...]) -> tuple[Target, ...]:
    """The targets and the first of them once more, numbered behind the last, so that all others keep their numbers."""
    return (*targets, targets[0].model_copy(update={"number": len(targets), "repeats_first": True}))


class Column(NamedTuple):
    """A quantity of a point as it is shown in tables and progress lines."""

    key: str
    """Name of the field of the point or of one of its parts."""
    heading: str
    """Heading of the column."""
    unit: str
    """Unit as it is shown."""
    pattern: str
    """Format of the number."""
    scale: float = 1.0
    """Factor from the stored unit to the shown one."""
    plain: bool = False
    """Whether its heading is left out of progress lines, where the unit already identifies it."""
    in_line: bool = True
    """Whether progress lines show it, too."""
    optional: bool = False
    """Whether it is shown only where there is a value."""
    counts_from: int = 0
    """What the stored 0 is shown as: 1 for numbers that people count from 1."""


class Plan(Configured):
    """Base of all plans."""

    kind: str
    """Kind of campaign."""
    description: str = ""
    """What the plan is for."""
    bench: str = Field(min_length=1)
    """Name of a shipped bench or a TOML file."""

    @property
    @abstractmethod
    def counts(self) -> dict[str, int]:
        """How many of each the plan goes through, by its key, from nothing but the fields; their product is that of points."""

    @model_validator(mode="after")
    def _not_too_many_points(self) -> Self:
        points = math.prod(self.counts.values())
        if points > MOST_POINTS:
            factors = " times ".join(f"{count} ({key})" for key, count in self.counts.items() if count > 1)
            largest = max(self.counts, key=lambda key: self.counts[key])
            raise ValueError(f"{largest}: {factors} are {points} points, allowed are up to {MOST_POINTS}")
        return self

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

    @property
    def known_plant(self) -> PlantModel | None:
        """Exciter and structure, where the plan knows them."""
        return None

    @property
    def evaluates_approach(self) -> bool:
        """Whether the rows of a point begin with the ramp to it; else with its record."""
        return False

    def together(self, number: int) -> frozenset[int]:
        """Numbers of the targets that are measured in one go with this one, itself included."""
        return frozenset((number,))

    def row_stride(self, number: int, sample_rate_hz: float) -> int:
        """Of how many rows one is stored while a target is measured; 1 for all."""
        return 1

    def waveforms(self, sample_rate_hz: float) -> np.ndarray | None:
        """Waveforms of unit peak that the segments play, float64[n, period]; None where they play none."""
        return None

    @abstractmethod
    def check(self, bench: Bench) -> None:
        """Raise `ConfigurationError`, before anything moves, for what the bench cannot do."""


class OpenLoopPlan(Plan):
    """Base of the plans without feedback of the phase: the frequency is the plan's."""

    controller: OpenLoop = Field(OpenLoop(), validation_alias=AliasChoices("controller", "demodulation"))
    """How force and response are demodulated beside the excitation, and the loops that hold levels in newtons or metres."""

    @property
    def law(self) -> Law:
        """No feedback of the phase."""
        return self.controller

    def check_frequencies(self, bench: Bench, **frequencies_hz: float) -> None:
        """Refuse a frequency outside the bench's limits."""
        lowest, highest = bench.limits.frequency_hz
        for name, frequency_hz in frequencies_hz.items():
            if not lowest <= frequency_hz <= highest:
                raise ConfigurationError(
                    f"{name} = {frequency_hz:g} Hz: the bench {bench.name} allows {lowest:g} to {highest:g} Hz"
                )


class TonePlan(Levels, OpenLoopPlan):
    """Base of the plans that put out one frequency at a time; every level is gone through in turn."""

    @property
    def counts(self) -> dict[str, int]:
        """Levels."""
        return self.level_count
