"""Knowledge of the plant in a plan, and the checks that it allows before anything moves."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from controller import AmplitudeLaw, PhaseLockedLoop
from controller.tuning import (
    LARGEST_AT_HALF,
    ControlLoop,
    PlantModel,
    closed_loop_poles,
    control_loop,
    gains_at_half,
    unstable_poles,
)
from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.campaigns.planning.levels import Levels
from rig.campaigns.planning.levels_on_plant import MORE_DAMPING, check_motion, check_voltage, lags_text
from rig.errors import ConfigurationError
from vibrolock.errors import InputError

DELAY_RESERVE = 1.5  # of the delay at which the gains must still be stable
DELAY_STEP = 1.25  # between delays that are tried
BISECTIONS = 5  # of the last step: to a percent
CLOSEST_DEG = 0.5  # spacing of the lags that are checked on the plant: at most a few hundred, each takes milliseconds


class PlantFacts(Configured):
    """Model of exciter and structure near the mode, from voltage to force and acceleration, as measured by ``rig tune``.

    See `controller.tuning.PlantModel`: force per volt is ``1/(alpha + beta Y)`` with the structure's accelerance Y.
    """

    frequency_rad_s: float = Field(gt=0)
    """Angular frequency of the mode of the structure alone, rad/s."""
    damping_ratio: float = Field(gt=0, lt=1)
    """Damping ratio of the mode."""
    drive_shape: float = Field(gt=0)
    """Mass-normalised mode shape at the drive point, kg^-1/2."""
    residual_per_kg: tuple[float, float]
    """Accelerance of the other modes, 1/kg: a constant, and the factor of (s/centre)^2."""
    force_v_n: tuple[float, float, float, float]
    """alpha, V/N: coefficients of (s/centre)^0 to ^3."""
    acceleration_v_s2_m: tuple[float, float, float, float]
    """beta, V s^2/m: coefficients of (s/centre)^-2 to ^1."""
    centre_rad_s: float = Field(gt=0)
    """Angular frequency that s is divided by, rad/s."""
    band_hz: tuple[float, float]
    """Fitted frequency band, Hz."""
    fit_error: float = Field(ge=0)
    """Relative error of the fit, root mean square."""
    sample_rate_hz: float = Field(gt=0)
    """Sample rate of the loop, Hz."""
    latency_samples: float = Field(ge=0)
    """Samples between an output and the input that responds to it."""
    frequency_std_rad_s: float | None = Field(None, ge=0)
    """Standard error of the frequency, rad/s; left out if unknown."""
    damping_ratio_std: float | None = Field(None, ge=0)
    """Standard error of the damping ratio; left out if unknown."""
    drive_shape_std: float | None = Field(None, ge=0)
    """Standard error of the mode shape, kg^-1/2, which is in that of every damping of the test; left out if unknown."""
    force_v_n_std: float | None = Field(None, ge=0)
    """Standard error of alpha at the mode, V/N: how well the exciter was told apart from the structure. Left out if unknown."""
    response_ratios: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Motion of each response channel per metre at the drive point, at resonance, by channel name. These ratios replace the
    bench's mode shapes when levels and channels are checked."""
    response_ratio_stds: dict[str, NonNegativeFloat] = Field(default_factory=dict)
    """Standard errors of the ratios, by channel name; a missing one is unknown."""
    response_turns_deg: dict[str, Annotated[float, Field(gt=-90, le=90)]] = Field(default_factory=dict)
    """By how much each response channel stands ahead of the phase of a real mode shape, 0 or 180 degrees against the drive
    point, at resonance, deg; a missing one is 0. Joints that damp make such turns."""

    @model_validator(mode="after")
    def _ratios_for_their_errors(self) -> Self:
        for key in ("response_ratio_stds", "response_turns_deg"):
            for name in getattr(self, key):
                if name not in self.response_ratios:
                    known = ", ".join(self.response_ratios) or "it has none"
                    raise InputError(field=f"{key}.{name}", allowed=f"a channel of response_ratios: {known}")
        return self

    @property
    def residual_m_n(self) -> float:
        """Receptance of the other modes at the drive point at the frequency of the tested mode, m/N."""
        return self.residual_at(self.frequency_rad_s / (2.0 * math.pi))

    def residual_at(self, frequency_hz: float) -> float:
        """Return the receptance of the other modes at the drive point at a frequency near the mode's, m/N."""
        constant, square = self.residual_per_kg
        omega = 2.0 * math.pi * frequency_hz
        return -(constant - square * (omega / self.centre_rad_s) ** 2) / omega**2

    @property
    def model(self) -> PlantModel:
        """The plant model."""
        return PlantModel(**self.model_dump(exclude={"response_ratios", "response_ratio_stds", "response_turns_deg"}))


class KnownPlant(Levels):
    """Levels of a plan that may contain a model of its plant."""

    plant: PlantFacts | None = None
    """The plant as measured by ``rig tune``. If it is given, gains that are unstable on it and levels beyond the bench's limits
    are refused."""

    @property
    def known_plant(self) -> PlantModel | None:
        """Model of exciter and structure, if the plan contains one."""
        return None if self.plant is None else self.plant.model

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

    def check_plant(self, bench: Bench, law: PhaseLockedLoop, lags_deg: Sequence[float]) -> None:
        """Refuse gains that are unstable or too quick on the known plant at one of the lags, and levels beyond its reach."""
        if self.plant is None:
            return
        plant, lags_deg = self.plant.model, _apart(lags_deg)
        try:
            # A sign detector cannot be linearised.
            if law.detector != "sign":
                loops = self._loops(plant, law, lags_deg, bench)
                _check_quickness(loops)
                _check_stability(loops)
            check_voltage(self, plant, lags_deg, bench)
            check_motion(self, plant, lags_deg, bench, self.ratios_to_drive(bench))
        except ValueError as error:
            raise ConfigurationError.of(error, within="plant") from None

    def check_delay_on_plant(
        self, bench: Bench, law: PhaseLockedLoop, lags_deg: Sequence[float], delay_s: float
    ) -> None:
        """Refuse gains that do not bear a delay on the known plant (`longest_delay_on_plant_s`)."""
        longest_s = self.longest_delay_on_plant_s(bench, law, lags_deg, delay_s)
        if delay_s <= longest_s:
            return
        given = ", ".join(f"{name} = {getattr(law, name):g}" for name in law.gain_names(self.amplitude_law))
        raise ConfigurationError(
            f"{given}: unstable on the known plant ([plant]) with {DELAY_RESERVE:g} times "
            f"{1000.0 * delay_s:.3g} ms from output to input",
            field="controller",
            allowed=f"up to {1000.0 * longest_s:.3g} ms: shorter blocks or queue, smaller gains, or those that `rig "
            "tune` finds with this delay",
        )

    def longest_delay_on_plant_s(
        self, bench: Bench, law: PhaseLockedLoop, lags_deg: Sequence[float], at_most_s: float
    ) -> float:
        """Return the longest delay, up to ``at_most_s``, that the gains bear: with `DELAY_RESERVE` times it they are stable.

        That of the plan itself is always allowed. ``at_most_s`` if the plant is not known.
        """
        known = self.known_plant
        if known is None or law.detector == "sign" or at_most_s <= known.delay_s:
            return at_most_s
        lags_deg = _apart(lags_deg)

        def unstable(seconds: float) -> bool:
            plant = replace(known, latency_samples=DELAY_RESERVE * seconds * known.sample_rate_hz)
            return any(unstable_poles(loop) > 0 for loop in self._loops(plant, law, lags_deg, bench))

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

    def _loops(
        self, plant: PlantModel, law: PhaseLockedLoop, lags_deg: Sequence[float], bench: Bench
    ) -> list[ControlLoop]:
        """Return the control loop at each lag.

        The steady force cannot be linearised. If it is used, only the inner loops are returned.
        """
        amplitude_law = self.amplitude_law
        if law.rest_low_pass_rad_s > 0.0 and amplitude_law in (AmplitudeLaw.FORCE, AmplitudeLaw.FORCE_RMS):
            through = law.force_loop == "through-response"
            amplitude_law = AmplitudeLaw.RESPONSE if through else AmplitudeLaw.VOLTAGE
        laws = [law.model_copy(update={"phase_lag_deg": lag}) for lag in lags_deg]
        return [control_loop(plant, at_lag, amplitude_law, plant.drive_shape) for at_lag in laws]


def _apart(lags_deg: Sequence[float]) -> list[float]:
    """Return the lags without those so close to the previous one that the loop is the same. The last lag is always included."""
    *rising, last = sorted(lags_deg)
    out: list[float] = []
    for lag in rising:
        if not out or lag - out[-1] >= CLOSEST_DEG:
            out.append(lag)
    return [*out, last]


def _check_quickness(loops: Sequence[ControlLoop]) -> None:
    """Refuse a loop that would have to act within a period or two, which is faster than any demodulator can follow."""
    found = [(gain, name, loop) for loop in loops for name, gain in gains_at_half(loop).items()]
    gain, name, loop = max(found, key=lambda entry: entry[0])
    if gain > LARGEST_AT_HALF:
        hertz = loop.omega_rad_s / 2.0 / math.pi
        raise ConfigurationError(
            f"the {name} is too quick on the known plant ([plant], {hertz:.2f} Hz)"
            f"{lags_text([loop.lag_deg])}: its gain at {0.5 * hertz:.4g} Hz, half the locked frequency, is {gain:.3g}",
            field="controller",
            allowed=f"{LARGEST_AT_HALF:g}: demodulated signals cannot follow changes within two periods",
            hint=f"its gains are about {gain / LARGEST_AT_HALF:.2g} times too large",
        )


def _check_stability(loops: Sequence[ControlLoop]) -> None:
    unstable = [loop for loop in loops if unstable_poles(loop) > 0]
    if not unstable:
        return
    growth = [max((float(pole.real) for pole in closed_loop_poles(loop)), default=0.0) for loop in unstable]
    worst = unstable[growth.index(max(growth))]
    enough = next((part for part in MORE_DAMPING if _steady(unstable, part)), None)
    damping = 100.0 * worst.plant.damping_ratio
    raise ConfigurationError(
        f"these gains are unstable on the known plant ([plant], {worst.omega_rad_s / 2.0 / math.pi:.2f} Hz, "
        f"{damping:.3g} % damping)"
        + lags_text([loop.lag_deg for loop in unstable])
        + (f", growing at {max(growth):.3g} 1/s" if max(growth) > 0.0 else "")
        + ("" if enough is None else f"; with {enough * damping:.3g} % they would be stable")
        + "; rig tune finds gains, without [plant] nothing is checked",
        field="controller",
    )


def _steady(loops: Sequence[ControlLoop], part: float) -> bool:
    """Whether all loops are stable with ``part`` times the damping; False if a lag does not exist on the damped plant."""
    damped = (replace(loop, plant=loop.plant.at(damping_ratio=part * loop.plant.damping_ratio)) for loop in loops)
    try:
        return not any(map(unstable_poles, damped))
    except ValueError:
        return False
