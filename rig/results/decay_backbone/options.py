"""Options for the evaluation of a free decay."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import Near, Option, Options


class DecayOptions(Options):
    """Options of ``rig identify decay``."""

    kind: ClassVar[str] = "decay"

    near: Near = ()
    """Frequencies with commas, Hz: one mode near each."""
    start_s: Annotated[float | None, Option(metavar="S", default="found", allowed="is 0 and above, s")] = Field(
        None, ge=0.0
    )
    """Where the free decay begins, from the first sample of the record."""
    stop_s: Annotated[float | None, Option(metavar="S", default="at the noise", allowed="is above `start_s`, s")] = (
        Field(None, gt=0.0)
    )
    """Where the free decay ends."""
    levels: int = Field(15, ge=1)
    """Number of levels of each mode."""
    drive_mode_shape: Annotated[
        float | None, Option(metavar="PHI", default="the bench's", allowed="is any number but 0, kg^-1/2")
    ] = None
    """Mass-normalised mode shape at the drive point, kg^-1/2."""
    point: int | None = Field(None, ge=1)
    """Number of the recorded point, or of the record of time data, from 1, if there are several."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stop_s is not None and self.stop_s <= (self.start_s or 0.0):
            raise ConfigurationError(self._fault("stop_s", self.stop_s))
        if self.drive_mode_shape == 0.0:
            raise ConfigurationError(self._fault("drive_mode_shape", self.drive_mode_shape))
        return self
