"""Parts shared by all campaigns under a phase lock: known plant, checks and acceptance limits."""

from dataclasses import replace
from itertools import product
from typing import Literal

from pydantic import Field

from controller import PhaseLockedLoop
from controller.tuning import PlantModel, unstable_poles
from rig.bench import Bench
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.levels import Levels
from rig.campaigns.planning.levels_on_plant import check_motion, check_voltage
from rig.campaigns.planning.plan import Plan, Target
from rig.campaigns.planning.plant import PlantFacts, check_quickness, check_stability, control_loops, lags_apart
from rig.errors import ConfigurationError
from rig.tick.sequencer.segments import SettleRule

DELAY_RESERVE = 1.5  # of the delay at which the gains must still be stable
HUNTING_PERIODS = 0.75  # of delay, with which the paper's controller hunts on the magnet beam
DELAY_STEP = 1.25  # between delays that are tried
BISECTIONS = 5  # of the last step: to a percent


class LockedPlan(Levels, Plan):
    """Base of the plans whose frequency is controlled to hold a phase lag."""

    plant: PlantFacts | None = None
    """The plant as measured by ``rig tune``. If it is given, gains that are unstable on it and levels beyond the bench's limits
    are refused."""
    controller: PhaseLockedLoop
    """The phase-locked loop, and the loops that hold levels in newtons or metres."""
    repeats: int = Field(1, ge=1, le=1000)
    """How many times all points are measured."""
    harmonics: int = Field(7, ge=1, le=50)
    """Highest harmonic evaluated."""
    accepted_nonharmonic_force: float = Field(0.1, gt=0, le=1)
    """Largest part of the force's RMS that is neither a harmonic nor noise with which a point is accepted. Its cause is another
    mode or an oscillating control loop."""
    near_limits: float = Field(1.0, gt=0, le=1)
    """Part of the bench's limits of force, acceleration and displacement. A level that brings a channel beyond it in its ramp
    up, or while it settles, is given up with those above it, as after a lost lock. With 1 only the limits themselves act."""
    noise_shaping: bool = False
    """Whether the error by which an output was rounded to the converter's bits (``output_resolution_v`` of the bench) is fed
    back into the next one: it then lies at high frequencies, not around that of the test. For outputs of few bits."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows a failed point: ``skip`` goes on with the next point, ``stop`` ramps down and ends the run."""

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels and repeats."""
        return {**self.level_count, "repeats": self.repeats}

    def targets(self) -> tuple[Target, ...]:
        """Return the levels of every repeat, rising."""
        pairs = product(range(1, self.repeats + 1), sorted(self.levels))
        return tuple(Target(number=n, level=level, repeat=repeat) for n, (repeat, level) in enumerate(pairs))

    @property
    def law(self) -> PhaseLockedLoop:
        """The phase-locked loop."""
        return self.controller

    @property
    def known_plant(self) -> PlantModel | None:
        """Model of exciter and structure, if the plan contains one."""
        return None if self.plant is None else self.plant.model

    @property
    def force_loop(self) -> str:
        """Name of the loop that would hold a force."""
        return self.controller.force_loop

    @property
    def displacement_lag_deg(self) -> float:
        """Lag of the displacement behind the force that the controller holds, deg."""
        return self.controller.phase_lag_deg + 180.0

    @property
    def asked_lags_deg(self) -> tuple[float, ...]:
        """All lags that are held, each of the acceleration behind the force, deg."""
        return (self.controller.phase_lag_deg,)

    def ratios_to_drive(self, bench: Bench) -> dict[str, float]:
        """Return the motion of each channel per metre at the drive point: as measured, else from the bench's mode shapes."""
        measured = {} if self.plant is None else self.plant.response_ratios
        names = [channel.name for channel in bench.channels if channel.role == "response"]
        for name in measured:
            if name not in names:
                raise ConfigurationError(
                    field=f"plant.response_ratios.{name}",
                    allowed=f"a response channel of the bench {bench.name}: {', '.join(names) or 'it has none'}",
                )
        return bench.response_ratios | measured

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        self.check_levels(bench)
        self._check_plant(bench)
        self._check_loop(bench)

    def longest_delay_s(self, bench: Bench, at_most_s: float) -> float:
        """Return the longest delay that the gains bear, s: on the known plant, or without one by a bound."""
        longest_s = super().longest_delay_s(bench, at_most_s)
        if self.plant is not None:
            return self._longest_delay_on_plant_s(longest_s)
        return min(longest_s, self.controller.longest_delay_s(self.amplitude_law))

    def check_delay(self, bench: Bench, loop_delay_samples: float) -> None:
        """Refuse gains that do not bear the delay: on the known plant, or without one by a bound."""
        super().check_delay(bench, loop_delay_samples)
        law, delay_s = self.controller, loop_delay_samples / bench.sample_rate_hz
        if self.plant is None:
            try:
                law.check_delay(delay_s, self.amplitude_law)
            except ValueError as error:
                raise ConfigurationError.of(
                    error, within="controller", further=["or shorter blocks or queue"]
                ) from None
            return
        longest_s = self._longest_delay_on_plant_s(delay_s)
        if delay_s > longest_s:
            given = ", ".join(f"{name} = {getattr(law, name):g}" for name in law.gain_names(self.amplitude_law))
            raise ConfigurationError(
                f"{given}: unstable on the known plant ([plant]) with {DELAY_RESERVE:g} times "
                f"{1000.0 * delay_s:.3g} ms from output to input",
                field="controller",
                allowed=f"up to {1000.0 * longest_s:.3g} ms: shorter blocks or queue, smaller gains, or those that `rig "
                "tune` finds with this delay",
            )

    def remark_on_delay(self, bench: Bench, loop_delay_s: float) -> str:
        """Say so where gains that no plant has proven meet a delay with which the paper's controller hunts."""
        periods = loop_delay_s * bench.specimen.linear_frequency_hz
        if self.plant is not None or periods < HUNTING_PERIODS:
            return ""
        return (
            f"the loop's delay of {1000.0 * loop_delay_s:.3g} ms is {periods:.2g} periods of the specimen, and the plan has no "
            "[plant] on which its gains could be checked: points may never settle; `rig tune` makes gains for this delay"
        )

    def _check_plant(self, bench: Bench) -> None:
        """Refuse gains that are unstable or too quick on the known plant at one of the lags, and levels beyond its reach."""
        plant = self.known_plant
        if plant is None:
            return
        lags_deg = lags_apart(self.asked_lags_deg)
        try:
            if self.controller.detector != "sign":  # which cannot be linearised
                loops = control_loops(plant, self.controller, self.amplitude_law, lags_deg)
                check_quickness(loops)
                check_stability(loops)
            check_voltage(self, plant, lags_deg, bench)
            check_motion(self, plant, lags_deg, bench, self.ratios_to_drive(bench))
        except ValueError as error:
            raise ConfigurationError.of(error, within="plant") from None

    def _longest_delay_on_plant_s(self, at_most_s: float) -> float:
        """Return the longest delay, up to ``at_most_s``, that the gains bear: with `DELAY_RESERVE` times it they are stable.

        That of the plan itself is always allowed.
        """
        law, known = self.controller, self.known_plant
        if known is None or law.detector == "sign" or at_most_s <= known.delay_s:
            return at_most_s
        rate_hz, lags_deg = known.sample_rate_hz, lags_apart(self.asked_lags_deg)

        def unstable(seconds: float) -> bool:
            plant = replace(known, latency_samples=DELAY_RESERVE * seconds * rate_hz)
            return any(unstable_poles(loop) > 0 for loop in control_loops(plant, law, self.amplitude_law, lags_deg))

        low = high = max(known.delay_s, 1e-6)  # stability is not monotone in the delay: the first limit is looked for
        while high < at_most_s:
            low, high = high, min(DELAY_STEP * high, at_most_s)
            if unstable(high):
                break
        else:
            return at_most_s
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if unstable(middle) else (middle, high)
        return low

    def _check_loop(self, bench: Bench) -> None:
        """Refuse a window without the tested mode or beyond the bench's limits, and harmonics beyond the sample rate."""
        window, allowed = self.controller.frequency_window_hz, bench.limits.frequency_hz
        linear = bench.specimen.linear_frequency_hz
        if not window[0] < linear < window[1]:
            raise ConfigurationError(
                field="controller.frequency_window_hz",
                value=list(window),
                allowed=f"around specimen.linear_frequency_hz = {linear:g} of the bench {bench.name}, the tested mode",
            )
        self.check_evaluated(self.harmonics, bench, window[1], spare=2)
        if window[0] < allowed[0] or window[1] > allowed[1]:
            raise ConfigurationError(
                f"the bench {bench.name} allows {list(allowed)} Hz",
                field="controller.frequency_window_hz",
                value=list(window),
            )

    def _check_slow_flow(self, bench: Bench) -> None:
        """Refuse a bench without the mode shape that the slow flow needs."""
        if drive_shape(bench, self.plant).value is None:
            raise ConfigurationError(
                f"specimen.drive_mode_shape of the bench {bench.name} is missing, and the plan has no [plant]: the slow flow "
                "needs it"
            )


class SettledPlan(LockedPlan):
    """Base of the plans whose points settle before they are recorded."""

    settle: SettleRule = SettleRule()
    """When a point counts as settled."""
    accepted_phase_error_deg: float = Field(3.0, gt=0, le=180)
    """Largest phase error of the recorded fundamental with which a point is accepted, deg."""
    accepted_frequency_scatter: float = Field(1e-3, gt=0, le=1)
    """Largest relative scatter of the frequency from period to period with which a point is accepted. A loop that hunts has not
    settled, whatever its averages are."""
    accepted_drift: float = Field(0.05, gt=0, le=1)
    """Largest relative change of the fundamental of force or drive over a record, in amplitude and phase together, with which a
    point is accepted. The filter of the detector hides changes late in a record."""
    on_lost_lock: Literal["skip", "stop"] = "stop"
    """What follows when a held lock is lost: ``stop`` trips, ``skip`` seeks the lock again at the next point."""
    lost_lock_attempts: int = Field(1, ge=1, le=3)
    """How often a point that loses its lock is tried in a run, with the points that were not reached for it. Each further
    attempt is a part of its own, once the plan is over: from the level before, with ramps of twice the length. Of a plan with
    ``on_lost_lock = "skip"``."""

    @property
    def settle_rule(self) -> SettleRule:
        """When a point counts as settled."""
        return self.settle
