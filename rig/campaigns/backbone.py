"""The backbone campaign: step through levels at phase resonance, settle, record whole periods at each."""

from typing import Literal, Self

from pydantic import Field, model_validator

from controller import AmplitudeLaw, PhaseLockedLoop
from rig.bench import Bench
from rig.campaigns.plan import Plan, Target
from rig.errors import ConfigurationError
from rig.sequencer.layout import OnFailure, SegmentKind
from rig.sequencer.segments import Segment, SettleRule

__all__ = ["BackbonePlan"]


class BackbonePlan(Plan):
    """Phase-resonant vibrations at a series of levels.

    The levels are either amplitudes of the output voltage (``levels_v``, the paper's way) or of the fundamental force
    (``levels_n``, held by the force loop K3, K4). Every point is approached by a half-cosine ramp, settled by the
    rule in ``settle``, and recorded over whole periods.
    """

    kind: Literal["backbone"] = "backbone"
    """Kind of campaign."""
    controller: PhaseLockedLoop
    """The phase-locked loop; the force loop where levels are in newtons."""
    levels_v: tuple[float, ...] | None = None
    """Levels as output amplitude, V peak."""
    levels_n: tuple[float, ...] | None = None
    """Levels as amplitude of the fundamental force, N peak."""
    direction: Literal["up", "down", "up-down"] = "up"
    """Order of the levels."""
    repeats: int = Field(1, ge=1, le=1000)
    """How many times the levels are passed through."""
    ramp_periods: float = Field(20.0, ge=1, le=1e5)
    """Length of the ramp between two levels, periods."""
    record_periods: int = Field(50, ge=4, le=1_000_000)
    """Periods that are recorded and evaluated at each level."""
    harmonics: int = Field(7, ge=1, le=50)
    """Highest harmonic that is evaluated."""
    settle: SettleRule = SettleRule()
    """When a point counts as settled."""
    accepted_phase_error_deg: float = Field(3.0, gt=0, le=180)
    """Largest phase error of the recorded fundamental with which a point is accepted, deg."""
    accepted_frequency_scatter: float = Field(1e-3, gt=0, le=1)
    """Largest scatter of the frequency from period to period, relative, with which a point is accepted: a loop that hunts
    has not settled, whatever its averages say."""
    accepted_drift: float = Field(0.05, gt=0, le=1)
    """Largest change of the fundamental of force or drive over a record, relative, in amplitude and phase together, with
    which a point is accepted: the detector's filter hides what happens late in a record."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows when a point does not settle, is disturbed or is out of reach: the next point, or a ramp-down."""
    on_lost_lock: Literal["skip", "stop"] = "stop"
    """What follows when a lock is lost at a held level: ``stop`` trips, ``skip`` seeks it again at the next level."""

    @model_validator(mode="after")
    def _levels_make_sense(self) -> Self:
        if (self.levels_v is None) == (self.levels_n is None):
            raise ValueError("levels_v, levels_n: exactly one of the two is to be given")
        name = "levels_v" if self.levels_v is not None else "levels_n"
        levels = self.levels
        if not levels:
            raise ValueError(f"{name} = []: at least one level is needed")
        for index, level in enumerate(levels):
            if level <= 0.0:
                raise ValueError(f"{name}[{index}] = {level:g}: allowed is above 0")
        if len(set(levels)) != len(levels):
            raise ValueError(f"{name}: a level is given twice; use repeats to measure levels again")
        return self

    @property
    def levels(self) -> tuple[float, ...]:
        """The levels, in V or N."""
        return self.levels_v if self.levels_v is not None else self.levels_n or ()

    @property
    def amplitude_law(self) -> AmplitudeLaw:
        """What the levels are."""
        return AmplitudeLaw.VOLTAGE if self.levels_v is not None else AmplitudeLaw.FORCE

    @property
    def level_unit(self) -> str:
        """``V`` or ``N``."""
        return "V" if self.amplitude_law is AmplitudeLaw.VOLTAGE else "N"

    @property
    def law(self) -> PhaseLockedLoop:
        """The phase-locked loop."""
        return self.controller

    @property
    def settle_rule(self) -> SettleRule:
        """When a point counts as settled."""
        return self.settle

    def targets(self) -> tuple[Target, ...]:
        """All points in the order of measurement."""
        rising = sorted(self.levels)
        falling = rising[::-1]
        passes: dict[str, list[tuple[float, Literal["up", "down"]]]] = {
            "up": [(level, "up") for level in rising],
            "down": [(level, "down") for level in falling],
            "up-down": [(level, "up") for level in rising] + [(level, "down") for level in falling[1:]],
        }
        return tuple(
            Target(number=number, level=level, direction=direction, repeat=repeat)
            for number, (repeat, level, direction) in enumerate(
                (repeat, level, direction)
                for repeat in range(1, self.repeats + 1)
                for level, direction in passes[self.direction]
            )
        )

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """The segments that measure all points but those ``done`` already.

        A point whose predecessor is done is approached from its predecessor's level, so that it is reached from the
        recorded direction.
        """
        failure, lost = (OnFailure[rule.upper()] for rule in (self.on_failure, self.on_lost_lock))
        targets = self.targets()
        out: list[Segment] = []
        at: float | None = None
        for target in targets:
            if target.number in done:
                continue
            before = self._approach(targets, target)
            if before is not None and before != at:
                out.append(Segment(SegmentKind.RAMP, -1, before, self.ramp_periods))
                out.append(Segment(SegmentKind.HOLD, -1, before, self._hold_periods))
            number, level = target.number, target.level
            out.append(Segment(SegmentKind.RAMP, number, level, self.ramp_periods))
            out.append(Segment(SegmentKind.SETTLE, number, level, self.settle.longest_periods, failure, lost))
            out.append(Segment(SegmentKind.RECORD, number, level, self.record_periods + 1.0, failure, lost))
            at = level
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench cannot do."""
        name, unit = ("levels_v", "V") if self.levels_v is not None else ("levels_n", "N")
        largest = bench.limits.voltage_v if self.levels_v is not None else bench.limits.force_n
        for index, level in enumerate(self.levels):
            if level > largest:
                raise ConfigurationError(
                    f"{name}[{index}] = {level:g} {unit}: the bench {bench.name} allows up to {largest:g} {unit}"
                )
        window, allowed = self.controller.frequency_window_hz, bench.limits.frequency_hz
        linear = bench.specimen.linear_frequency_hz
        if not window[0] < linear < window[1]:
            raise ConfigurationError(
                f"controller.frequency_window_hz = {list(window)}: allowed is a window around the tested mode's "
                f"specimen.linear_frequency_hz = {linear:g} of the bench {bench.name}"
            )
        highest = int(bench.sample_rate_hz / window[1] / 2.0) - 2
        if self.harmonics > highest:
            raise ConfigurationError(
                f"harmonics = {self.harmonics}: allowed is up to {highest} at {bench.sample_rate_hz:g} samples/s"
            )
        if window[0] < allowed[0] or window[1] > allowed[1]:
            raise ConfigurationError(
                f"controller.frequency_window_hz = {list(window)}: the bench {bench.name} allows {list(allowed)} Hz"
            )

    @property
    def _hold_periods(self) -> float:
        return float(2 * self.settle.average_periods + self.settle.settled_periods)

    @staticmethod
    def _approach(targets: tuple[Target, ...], target: Target) -> float | None:
        """Level to come from: the one before, where that lies on the same way; None to come from rest."""
        if target.number == 0:
            return None
        before = targets[target.number - 1]
        rises = target.level > before.level
        return before.level if rises == (target.direction == "up") else None
