"""Knowledge of the plant in a plan, and the checks of the gains that it allows before anything moves."""

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
from rig.bench.configuration import Configured
from rig.campaigns.planning.levels_on_plant import MORE_DAMPING, lags_text
from rig.errors import ConfigurationError
from vibrolock.errors import InputError

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


def control_loops(
    plant: PlantModel, law: PhaseLockedLoop, amplitude_law: AmplitudeLaw, lags_deg: Sequence[float]
) -> list[ControlLoop]:
    """Return the control loop at each lag.

    The steady force cannot be linearised. If it is used, only the inner loops are returned.
    """
    if law.rest_low_pass_rad_s > 0.0 and amplitude_law in (AmplitudeLaw.FORCE, AmplitudeLaw.FORCE_RMS):
        through = law.force_loop == "through-response"
        amplitude_law = AmplitudeLaw.RESPONSE if through else AmplitudeLaw.VOLTAGE
    laws = [law.model_copy(update={"phase_lag_deg": lag}) for lag in lags_deg]
    return [control_loop(plant, at_lag, amplitude_law, plant.drive_shape) for at_lag in laws]


def lags_apart(lags_deg: Sequence[float]) -> list[float]:
    """Return the lags without those so close to the previous one that the loop is the same. The last lag is always included."""
    *rising, last = sorted(lags_deg)
    out: list[float] = []
    for lag in rising:
        if not out or lag - out[-1] >= CLOSEST_DEG:
            out.append(lag)
    return [*out, last]


def check_quickness(loops: Sequence[ControlLoop]) -> None:
    """Refuse a loop that would have to act within a period or two, which is faster than any demodulator can follow."""
    found = [(gain, name, loop) for loop in loops for name, gain in gains_at_half(loop).items()]
    gain, name, loop = max(found, key=lambda entry: entry[0])
    if gain > LARGEST_AT_HALF:
        hertz = loop.omega_rad_s / 2.0 / math.pi
        raise ConfigurationError(
            f"the {name} is too fast on the known plant ([plant], {hertz:.2f} Hz)"
            f"{lags_text([loop.lag_deg])}: its gain at {0.5 * hertz:.4g} Hz, half the locked frequency, is {gain:.3g}",
            field="controller",
            allowed=f"{LARGEST_AT_HALF:g}: demodulated signals cannot follow changes within two periods",
            hint=f"its gains are about {gain / LARGEST_AT_HALF:.2g} times too large",
        )


def check_stability(loops: Sequence[ControlLoop]) -> None:
    """Refuse loops that are unstable, and say with how much damping they would be stable."""
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
