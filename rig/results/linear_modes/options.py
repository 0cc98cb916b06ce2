"""Options for the identification of linear modes."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from identification.common import Weighting
from rig.errors import ConfigurationError
from rig.measurements import Estimator
from rig.results.options import BandHz, Near, Option, Options


class LinearOptions(Options):
    """Options of ``rig identify linear``."""

    kind: ClassVar[str] = "linear"

    estimator: Estimator = "instrument"
    """Estimator of the frequency responses: instrument (by the drive voltage), H1 or H2."""
    band_hz: BandHz = None
    """Band of the lines to which the modes are fitted, Hz."""
    count: Annotated[int | None, Option(default="found")] = Field(None, ge=1)
    """Number of modes."""
    near: Near = ()
    """Frequencies with commas, Hz: one mode near each."""
    order: Annotated[int | None, Option(default="40, or less for few lines")] = Field(None, ge=2)
    """Highest order of the stabilisation diagram."""
    weighting: Weighting = "auto"
    """Weights of the lines: auto, total (with distortion), noise or relative."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.near and self.count is not None:
            raise ConfigurationError("`count`: is the number of frequencies in `near`; leave one of them out")
        return self
