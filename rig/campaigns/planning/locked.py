"""Parts shared by all campaigns under a phase lock: known plant, checks and acceptance limits."""

from typing import Literal

from pydantic import Field

from controller import PhaseLockedLoop
from rig.bench import Bench
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.plan import Plan
from rig.campaigns.planning.plant import KnownPlant
from rig.errors import ConfigurationError
from rig.tick.sequencer.segments import SettleRule


class LockedPlan(KnownPlant, Plan):
    """Base of the plans whose frequency is controlled to hold a phase lag."""

    controller: PhaseLockedLoop
    """The phase-locked loop, and the loops that hold levels in newtons or metres."""
    repeats: int = Field(1, ge=1, le=1000)
    """How many times all points are measured."""
    harmonics: int = Field(7, ge=1, le=50)
    """Highest harmonic evaluated."""
    accepted_nonharmonic_force: float = Field(0.1, gt=0, le=1)
    """Largest part of the force's RMS that is neither a harmonic nor noise with which a point is accepted. Its cause is another
    mode or an oscillating control loop."""
    on_failure: Literal["skip", "stop"] = "skip"
    """What follows a failed point: ``skip`` goes on with the next point, ``stop`` ramps down and ends the run."""

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels and repeats."""
        return {**self.level_count, "repeats": self.repeats}

    @property
    def law(self) -> PhaseLockedLoop:
        """The phase-locked loop."""
        return self.controller

    @property
    def force_loop(self) -> str:
        """Name of the loop that would hold a force."""
        return self.controller.force_loop

    @property
    def asked_lags_deg(self) -> tuple[float, ...]:
        """All lags that are held, each of the acceleration behind the force, deg."""
        return (self.controller.phase_lag_deg,)

    def check(self, bench: Bench) -> None:
        """Refuse, before anything moves, what the bench or the known plant cannot do."""
        self.check_levels(bench)
        self.check_plant(bench, self.controller, self.asked_lags_deg)
        self._check_loop(bench)

    def longest_delay_s(self, bench: Bench, at_most_s: float) -> float:
        """Return the longest delay that the gains bear, s: on the known plant, or without one by a bound."""
        longest_s = super().longest_delay_s(bench, at_most_s)
        if self.plant is not None:
            return self.longest_delay_on_plant_s(bench, self.controller, self.asked_lags_deg, longest_s)
        return min(longest_s, self.controller.longest_delay_s(self.amplitude_law))

    def check_delay(self, bench: Bench, loop_delay_samples: float) -> None:
        """Refuse gains that do not bear the delay."""
        super().check_delay(bench, loop_delay_samples)
        delay_s = loop_delay_samples / bench.sample_rate_hz
        if self.plant is not None:
            self.check_delay_on_plant(bench, self.controller, self.asked_lags_deg, delay_s)
            return
        try:
            self.controller.check_delay(delay_s, self.amplitude_law)
        except ValueError as error:
            raise ConfigurationError.of(error, within="controller", further=["or shorter blocks or queue"]) from None

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

    @property
    def settle_rule(self) -> SettleRule:
        """When a point counts as settled."""
        return self.settle
