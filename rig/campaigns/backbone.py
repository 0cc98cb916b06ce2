"""The backbone campaign: step through levels at phase resonance, settle, record whole periods at each."""

from dataclasses import replace
from typing import Literal

from pydantic import Field

from controller import PhaseLockedLoop
from rig.bench import Bench
from rig.campaigns.known_plant import KnownPlant
from rig.campaigns.plan import Plan, Target
from rig.errors import ConfigurationError
from rig.sequencer.layout import OnFailure, SegmentKind
from rig.sequencer.segments import Segment, SettleRule

__all__ = ["BackbonePlan", "check_loop"]


class BackbonePlan(KnownPlant, Plan):
    """Phase-resonant vibrations at a series of levels.

    The levels are amplitudes of the output voltage (``levels_v``, the paper's way), or of force or response, held by the
    controller's loops. Every point is approached by a half-cosine ramp, settled by the
    rule in ``settle``, and recorded over whole periods.
    """

    kind: Literal["backbone"] = "backbone"
    """Kind of campaign."""
    controller: PhaseLockedLoop
    """The phase-locked loop, and the loops that hold levels in newtons or metres."""
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
    evaluation: Literal["settled", "slow-flow"] = "settled"
    """Whether a point is settled and then recorded, or taken from the ramp to it and what follows, by the slow flow: nothing is
    waited for."""
    settle: SettleRule = SettleRule()
    """When a point counts as settled; with ``slow-flow`` nothing waits for it."""
    accepted_phase_error_deg: float = Field(3.0, gt=0, le=180)
    """Largest phase error of the recorded fundamental with which a point is accepted, deg."""
    accepted_frequency_scatter: float = Field(1e-3, gt=0, le=1)
    """Largest scatter of the frequency from period to period, relative, with which a point is accepted: a loop that hunts
    has not settled, whatever its averages say."""
    accepted_drift: float = Field(0.05, gt=0, le=1)
    """Largest change of the fundamental of force or drive over a record, relative, in amplitude and phase together, with
    which a point is accepted: the detector's filter hides what happens late in a record."""
    accepted_frequency_std: float = Field(1e-3, gt=0, le=1)
    """Largest standard error of the modal frequency, relative, with which a point of the slow flow is accepted."""
    accepted_damping_std: float = Field(0.1, gt=0, le=1)
    """Largest standard error of the damping, relative, with which a point of the slow flow is accepted."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows when a point does not settle, is disturbed or is out of reach: the next point, or a ramp-down."""
    on_lost_lock: Literal["skip", "stop"] = "stop"
    """What follows when a lock is lost at a held level: ``stop`` trips, ``skip`` seeks it again at the next level."""

    @property
    def law(self) -> PhaseLockedLoop:
        """The phase-locked loop."""
        return self.controller

    @property
    def evaluates_approach(self) -> bool:
        """Whether the ramp is evaluated with the rest: by the slow flow."""
        return self.evaluation == "slow-flow"

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
        out = self.start_segments()
        at: float | None = None
        for target in targets:
            if target.number in done:
                continue
            before = self._approach(targets, target)
            if before is not None and before != at:
                out.append(Segment(SegmentKind.RAMP, -1, before, self.ramp_periods))
                out.append(Segment(SegmentKind.HOLD, -1, before, self._hold_periods))
            number, level = target.number, target.level
            at, first = level, at is None and before is None
            if self.evaluation == "slow-flow":
                out += self._short_point(target, failure, first)
                continue
            out.append(Segment(SegmentKind.RAMP, number, level, self.ramp_periods))
            out.append(Segment(SegmentKind.SETTLE, number, level, self.settle.longest_periods, failure, lost))
            out.append(Segment(SegmentKind.RECORD, number, level, self.record_periods + 1.0, failure, lost))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench cannot do."""
        self.check_levels(bench)
        self.check_plant(bench, self.controller)
        check_loop(self.controller, self.harmonics, bench)
        if self.evaluation == "slow-flow" and bench.specimen.drive_mode_shape is None:
            raise ConfigurationError(
                f"specimen.drive_mode_shape of the bench {bench.name} is missing: the slow flow needs it"
            )

    def _short_point(self, target: Target, failure: OnFailure, first: bool) -> list[Segment]:
        """The ramp to a point and the time at it, both evaluated; before the first the lock is gained at its level."""
        number, level = target.number, target.level
        geometric = self.levels_key != "levels_v"
        ramp = Segment(SegmentKind.RAMP, number, level, self.ramp_periods, failure, geometric=geometric)
        out = [replace(ramp, point=-1), replace(ramp, kind=SegmentKind.HOLD, point=-1, periods=self._hold_periods)]
        # A ramp from a level to itself: judged by what it shows, not by the settle rule.
        held = replace(ramp, kind=SegmentKind.LEVEL_SWEEP, periods=self.record_periods)
        return [*(out if first else ()), ramp, held]

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


def check_loop(loop: PhaseLockedLoop, harmonics: int, bench: Bench) -> None:
    """Refuse a window without the tested mode or beyond the bench's limits, and harmonics beyond the sample rate."""
    window, allowed = loop.frequency_window_hz, bench.limits.frequency_hz
    linear = bench.specimen.linear_frequency_hz
    if not window[0] < linear < window[1]:
        raise ConfigurationError(
            f"controller.frequency_window_hz = {list(window)}: allowed is a window around the tested mode's "
            f"specimen.linear_frequency_hz = {linear:g} of the bench {bench.name}"
        )
    highest = int(bench.sample_rate_hz / window[1] / 2.0) - 2
    if harmonics > highest:
        raise ConfigurationError(
            f"harmonics = {harmonics}: allowed is up to {highest} at {bench.sample_rate_hz:g} samples/s"
        )
    if window[0] < allowed[0] or window[1] > allowed[1]:
        raise ConfigurationError(
            f"controller.frequency_window_hz = {list(window)}: the bench {bench.name} allows {list(allowed)} Hz"
        )
