"""Options for the identification of an exciter."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import BandHz, Option, Options


class ExciterOptions(Options):
    """Options of ``rig identify exciter``."""

    kind: ClassVar[str] = "exciter"

    band_hz: BandHz = None
    """Band of the lines to which the exciter is fitted, Hz."""
    resistance_ohm: Annotated[float | None, Option(metavar="OHM")] = Field(None, gt=0.0)
    """Resistance of coil, cable and amplifier together, if measured with a meter."""
    amplifier_gain: Annotated[float | None, Option(metavar="V/V", default="1")] = Field(None, gt=0.0)
    """Gain of the voltage amplifier, for the resistance."""
    stinger_stiffness_n_m: Annotated[float | None, Option(metavar="N_PER_M")] = Field(None, gt=0.0)
    """Stiffness of the stinger (E A / l), if known."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.amplifier_gain is not None and self.resistance_ohm is None:
            raise ConfigurationError("`amplifier_gain`: is for the resistance; add `resistance_ohm`, or leave it out")
        return self
