"""Options for the evaluation of a free decay."""

import math
from dataclasses import dataclass

from rig.errors import ConfigurationError
from rig.results.simulated.options import Options


@dataclass(frozen=True, kw_only=True)
class DecayOptions(Options):
    """Options of ``rig identify --model decay``. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    start_s: float | None = None
    """Where the free decay begins, s from the first sample of the record."""
    stop_s: float | None = None
    """Where it ends, s."""
    levels: int | None = None
    """Number of levels of each mode; 15 if None."""
    drive_mode_shape: float | None = None
    """Mass-normalised mode shape at the drive point, kg^-1/2; that of the recording's bench if None."""
    point: int | None = None
    """Number of the recorded point, or of the record of time data, from 1, if the file has several."""

    def __post_init__(self) -> None:
        if self.start_s is not None and not 0.0 <= self.start_s < math.inf:
            raise ConfigurationError(f"`start_s` = {self.start_s:g}: allowed is 0 and above, s")
        if self.stop_s is not None and not (self.start_s or 0.0) < self.stop_s < math.inf:
            raise ConfigurationError(f"`stop_s` = {self.stop_s:g}: allowed is above `start_s`, s")
        for name in ("levels", "point"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ConfigurationError(f"`{name}` = {value}: allowed is 1 and above")
        shape = self.drive_mode_shape
        if shape is not None and not (math.isfinite(shape) and shape):
            raise ConfigurationError(f"`drive_mode_shape` = {shape:g}: allowed is any number but 0, kg^-1/2")
