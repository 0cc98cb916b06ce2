"""Base classes of all plans: points to measure, the segments that measure them, and the requirements on bench and law."""

import math
from abc import abstractmethod
from collections.abc import Iterable
from typing import Literal, Self

from pydantic import AliasChoices, Field, model_validator

from controller import AmplitudeLaw, Law, OpenLoop
from controller.tuning import PlantModel
from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.campaigns.planning.levels import Levels
from rig.errors import ConfigurationError
from rig.tick.sequencer.segments import Segment, SettleRule, highest_frequency_hz
from vibrolock.arrays import Float
from vibrolock.errors import InputError

MOST_POINTS = 10_000
"""Most points of a plan, including repeats and both directions: at ten seconds a point, more than a day. See also
`rig.campaigns.planning.lengths`."""


class Target(Configured):
    """One point of a plan: its coordinates and the side from which it is approached."""

    number: int
    """Number of the point, from 0, in the order of measurement."""
    level: float
    """Level in the plan's unit: V, N or m."""
    direction: Literal["up", "down"] = "up"
    """Whether the previous level or frequency was lower (``up``) or higher (``down``). This matters if the specimen has
    hysteresis."""
    repeat: int = 1
    """Number of the pass, from 1."""
    frequency_hz: float | None = None
    """Frequency, if the plan gives one, Hz."""
    phase_lag_deg: float | None = None
    """Wanted lag of the drive-point acceleration behind the force, if the plan gives one, deg."""
    realisation: int | None = None
    """Number of a multisine's realisation, from 0."""
    harmonics: dict[int, tuple[float, float]] | None = None
    """Harmonics that the harmonics loop makes, if the plan prescribes them for this point: amplitude relative to the
    fundamental, and phase in deg."""
    repeats_first: bool = False
    """Whether this is the repetition of the first point at the end, which reveals a drift. It enters no result."""


def passes(values: Iterable[float], direction: str) -> list[tuple[float, Literal["up", "down"]]]:
    """Return each value with its direction: rising (``up``), falling (``down``), or rising and falling (``up-down``).

    ``up-down`` has the highest value once.
    """
    rising = sorted(values)
    out: list[tuple[float, Literal["up", "down"]]] = [] if direction == "down" else [(value, "up") for value in rising]
    falling = rising[::-1] if direction == "down" else rising[-2::-1]
    return out if direction == "up" else [*out, *((value, "down") for value in falling)]


def with_first_repeated(targets: tuple[Target, ...]) -> tuple[Target, ...]:
    """Append the first target once more. It is numbered after the last target, so that all others keep their numbers."""
    return (*targets, targets[0].model_copy(update={"number": len(targets), "repeats_first": True}))


class Plan(Configured):
    """Base of all plans."""

    kind: str
    """Kind of campaign."""
    description: str = ""
    """Purpose of the plan, shown by ``rig list``."""
    bench: str = Field(min_length=1)
    """Name of a shipped bench, or a TOML file, which is looked for beside the plan."""
    retries: int = Field(2, ge=0, le=20)
    """How many times, at most, a point is measured again that was rejected for a cause that passes: held outputs, lost
    samples, a disturbance of the vibration."""

    rows: Literal["all", "records"] = "all"
    """Which rows are stored: all of them, or all rows of the records that are evaluated and few of those between."""
    telemetry_s: float = Field(0.1, gt=0, le=60)
    """Time between stored rows where not all rows are stored, s."""

    @property
    @abstractmethod
    def counts(self) -> dict[str, int]:
        """Numbers of levels, repeats and so on, by plan key, from the fields alone. Their product is at most `MOST_POINTS`."""

    @model_validator(mode="after")
    def _not_too_many_points(self) -> Self:
        points = math.prod(self.counts.values())
        if points > MOST_POINTS:
            factors = " times ".join(f"{count} ({key})" for key, count in self.counts.items() if count > 1)
            largest = max(self.counts, key=lambda key: self.counts[key])
            raise InputError(f"{factors} are {points} points", field=largest, allowed=f"up to {MOST_POINTS}")
        return self

    @property
    def level_unit(self) -> str:
        """Unit of the levels."""
        return "V"

    @property
    def levels_key(self) -> str:
        """Name of the key that gives the levels."""
        return "levels_rms_v"

    @property
    def sweep_s(self) -> float:
        """Duration of a frequency sweep, s; 0 if the plan sweeps none."""
        return 0.0

    @property
    def amplitude_law(self) -> AmplitudeLaw:
        """Quantity that the levels of the segments refer to."""
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
        """Return all points in the order of measurement."""

    @abstractmethod
    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that measure all points except those in ``done``."""

    @property
    def known_plant(self) -> PlantModel | None:
        """Model of exciter and structure, if the plan contains one."""
        return None

    @property
    def evaluates_approach(self) -> bool:
        """Whether the rows of a point begin with the ramp to the point; otherwise they begin with its record."""
        return False

    def together(self, number: int) -> frozenset[int]:
        """Return the numbers of the targets that are measured together with this one, including its own."""
        return frozenset((number,))

    def stores_record(self, number: int) -> bool:
        """Whether all rows of a target's record are stored."""
        return True

    def row_stride(self, number: int, sample_rate_hz: float, *, evaluated: bool = True) -> int:
        """Return the number of rows per stored row while a target (-1: none) is measured; 1 stores all rows.

        ``evaluated``: whether these rows are evaluated, or only lead there.
        """
        full = number < 0 or self.stores_record(number)
        if full and (evaluated or self.rows == "all"):
            return 1
        return max(1, round(self.telemetry_s * sample_rate_hz))

    def waveforms(self, sample_rate_hz: float) -> Float | None:
        """Return the waveforms of unit peak that the segments play, float64[n, period]; None if they play none."""
        return None

    def check_evaluated(self, harmonics: int, bench: Bench, highest_hz: float, spare: int) -> None:
        """Refuse more ``harmonics`` of a frequency than are measured: ``spare`` fewer than half the samples of a period."""
        rate_hz = bench.sample_rate_hz
        most = int(rate_hz / highest_hz / 2.0) - spare
        if most < 1:
            raise ConfigurationError(
                f"is too high for {rate_hz:g} samples/s of the bench {bench.name}",
                field="highest frequency",
                value=highest_hz,
                unit="Hz",
                allowed=f"up to {rate_hz / (2.0 * (1 + spare)):g} Hz",
            )
        if harmonics > most:
            raise ConfigurationError(
                field="harmonics",
                value=harmonics,
                allowed=f"up to {most} of {highest_hz:g} Hz at {rate_hz:g} samples/s",
            )

    @property
    def feedback(self) -> bool:
        """Whether outputs answer what is measured; otherwise all of them are known in advance."""
        return True

    @abstractmethod
    def check(self, bench: Bench) -> None:
        """Raise `ConfigurationError`, before anything moves, for what the bench cannot do."""

    def longest_delay_s(self, bench: Bench, at_most_s: float) -> float:
        """Return the longest delay, up to ``at_most_s``, from an output to the input that shows it that the gains bear, s."""
        loop = self.law.harmonics
        if loop is None:
            return at_most_s
        highest_hz = highest_frequency_hz(self.law, self.segments(bench.sample_rate_hz))
        return min(at_most_s, loop.longest_delay_s(highest_hz))

    def check_delay(self, bench: Bench, loop_delay_samples: float) -> None:
        """Raise `ConfigurationError` for gains that are not stable with ``loop_delay_samples`` from output to input.

        These are known once a device has its queue: block, queue, hold and filters.
        """
        loop, rate_hz = self.law.harmonics, bench.sample_rate_hz
        if loop is None:
            return
        try:
            loop.check_frequency(rate_hz, highest_frequency_hz(self.law, self.segments(rate_hz)), loop_delay_samples)
        except ValueError as error:
            raise ConfigurationError.of(error, within="controller") from None

    def remark_on_delay(self, bench: Bench, loop_delay_s: float) -> str:
        """Return a line for the person who runs the test, if the delay (s) may be too long for the gains; else nothing."""
        return ""


class OpenLoopPlan(Plan):
    """Base of the plans without phase feedback: the plan prescribes the frequency."""

    controller: OpenLoop = Field(OpenLoop(), validation_alias=AliasChoices("controller", "demodulation"))
    """Demodulation of force and response, and the loops that hold levels in newtons or metres. It may also be called
    ``demodulation``."""

    @property
    def law(self) -> Law:
        """The control law, which has no phase feedback."""
        return self.controller

    @property
    def feedback(self) -> bool:
        """Whether a level in newtons or metres is held, or the harmonics loop is on."""
        return self.amplitude_law is not AmplitudeLaw.VOLTAGE or self.controller.harmonics is not None

    def check_frequencies(self, bench: Bench, **frequencies_hz: float) -> None:
        """Refuse a frequency outside the bench's limits."""
        lowest, highest = bench.limits.frequency_hz
        for name, frequency_hz in frequencies_hz.items():
            if not lowest <= frequency_hz <= highest:
                raise ConfigurationError(
                    f"the bench {bench.name} allows {lowest:g} to {highest:g} Hz",
                    field=name,
                    value=frequency_hz,
                    unit="Hz",
                )

    def check_no_harmonics(self, why: str) -> None:
        """Refuse the harmonics loop, because ``why``."""
        if self.controller.harmonics is not None:
            raise ConfigurationError(f"not allowed with kind = {self.kind!r}, {why}", field="controller.harmonics")


class TonePlan(Levels, OpenLoopPlan):
    """Base of the plans that excite one frequency at a time. The levels are measured one after the other."""

    @property
    def force_loop(self) -> str:
        """Name of the loop that would hold a force."""
        return self.controller.force_loop

    @property
    def counts(self) -> dict[str, int]:
        """Number of levels."""
        return self.level_count
