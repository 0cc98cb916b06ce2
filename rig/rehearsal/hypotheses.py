"""Prior ranges of unmeasured properties of a twin, as a table (TOML)."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from rig.bench.configuration import Configured, read_toml, validated
from vibrolock.errors import InputError


class Hypotheses(Configured):
    """Prior ranges of unmeasured properties of a twin.

    Probabilities are those with which a twin has a property. Sizes are drawn log-uniformly between their bounds unless
    something else is said. The highest level is the largest displacement that the plan asks for on the linear rig.
    """

    hardening: float = Field(0.35, ge=0.0, le=1.0)
    """Probability of a spring that hardens."""
    hardening_powers: tuple[Literal[2, 4, 6], ...] = Field((2, 4, 6), min_length=1)
    """Powers of the amplitude by which its stiffness grows, all alike: 2 of a cubic spring, more of magnets and stops that come
    near. The backbone of a power p is p times as steep as its shift."""
    softening: float = Field(0.35, ge=0.0, le=1.0)
    """Probability of a spring that softens, with a stiffness that stays above a bound."""
    shift: tuple[float, float] = (0.002, 0.12)
    """Relative shift of the modal frequency at the highest level, by either spring."""
    damping_growth: tuple[float, float] = (1.0, 1.5)
    """Damping ratio at the highest level over that at a low one, by drag; every twin has some drag."""
    joint: float = Field(0.2, ge=0.0, le=1.0)
    """Probability of a joint that slips, beside the springs."""
    joint_shift: tuple[float, float] = (0.002, 0.05)
    """Relative fall of the modal frequency when the joint slips altogether."""
    joint_slip: tuple[float, float] = (0.3, 3.0)
    """Displacement at which the joint slips altogether, over that of the highest level."""
    stop: float = Field(0.1, ge=0.0, le=1.0)
    """Probability of a stop that is met."""
    stop_gap: tuple[float, float] = (0.3, 1.0)
    """Clearance of the stop, over the displacement of the highest level."""
    stop_stiffness: tuple[float, float] = (0.03, 1.0)
    """Stiffness of the stop, over the modal stiffness of the specimen at its place."""
    second_mode: float = Field(0.1, ge=0.0, le=1.0)
    """Probability of a mode nearby that no measurement has shown."""
    second_mode_at: tuple[float, float] = (0.7, 1.5)
    """Frequency of the mode nearby over that of the tested mode; it keeps at least 5 % away."""
    second_mode_shape: tuple[float, float] = (0.003, 0.03)
    """Drive-point shape of the mode nearby over that of the tested mode; a mode so weak does not show in a fit."""
    mode_shape: float = Field(1.5, ge=1.0, le=10.0)
    """Factor, either way, by which the bench's mode shape may be wrong where it was not measured (two standard deviations)."""
    gain: float = Field(0.03, ge=0.0, le=1.0)
    """Probability that the amplifier's gain is not that of the measurement."""
    gain_factor: tuple[float, float] = (0.5, 2.0)
    """Gain of the amplifier over the measured one, where it differs."""
    frequency_drift: float = Field(0.002, ge=0.0, le=0.1)
    """Standard deviation of the relative change of the modal frequency since the measurement, as temperature makes it."""
    damping_drift: float = Field(0.05, ge=0.0, le=1.0)
    """Standard deviation of the logarithm of the change of damping since the measurement."""
    late_per_s: float = Field(0.0, ge=0.0, le=1000.0)
    """Rate at which outputs come too late and the device goes on with their last period, 1/s."""
    held_per_s: float = Field(0.0, ge=0.0, le=1000.0)
    """The same of a device that cannot, and holds its output, 1/s, as `rig doctor` counts them."""
    lost_per_s: float = Field(0.0, ge=0.0, le=1000.0)
    """Rate of blocks of inputs that are lost, 1/s."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.hardening + self.softening > 1.0:
            total = self.hardening + self.softening
            raise ValueError(f"hardening + softening = {total:g}: allowed is up to 1, a twin has one spring at most")
        for name, value in self:
            if isinstance(value, tuple) and name != "hardening_powers" and not 0.0 < value[0] <= value[1]:
                raise InputError(field=name, value=list(value), allowed="two numbers above 0, the lower one first")
        for name in ("shift", "joint_shift"):
            highest = getattr(self, name)[1]
            if highest >= 0.5:
                raise InputError(field=name, value=list(getattr(self, name)), allowed="below 0.5")
        return self


def load_hypotheses(path: str | Path) -> Hypotheses:
    """Read a table of hypotheses; keys that it does not give keep their defaults. Raises `ConfigurationError`."""
    return validated(Hypotheses, read_toml(Path(path)), str(path))
