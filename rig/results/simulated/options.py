"""Options for the data of models that are fitted over time."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.errors import ConfigurationError

_INPUTS = ("force", "voltage")
_SCATTERING = ("frequency", "damping", "gain")


class Options:
    """Base of groups of options in which None, or nothing, stands for an option that was not given."""

    def given(self) -> dict[str, bool]:
        """Return which options were given."""
        return {name: value not in (None, ()) for name, value in vars(self).items()}


@dataclass(frozen=True, kw_only=True)
class DataOptions(Options):
    """Which data a PNLSS or structured model is fitted to and judged by. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    rate_hz: float | None = None
    """Sample rate of the model."""
    input: str | None = None
    """``force`` or ``voltage``."""
    outputs: str | None = None
    """Names of the outputs, separated by commas. Default: all motions, and the force if the voltage is the input."""
    validation: tuple[Path, ...] = ()
    """Recordings by which the model is judged. They choose the iterate of a PNLSS model."""
    hold_out: int | None = None
    """Number of last realisations of each level by which the model is judged instead. If a recording has at least five
    settled points, every fourth of them is used as well. 1 if None; with 0 nothing is held out."""
    relative: bool | None = None
    """Whether the errors of each experiment count relative to its outputs. Otherwise absolute errors count, and large levels
    dominate."""
    scatter: str | None = None
    """What shifts from run to run, separated by commas: ``frequency`` and ``damping`` of the modes in the excited band, and
    ``gain``. Every recording is a run."""

    def __post_init__(self) -> None:
        if self.hold_out is not None and self.hold_out < 0:
            raise ConfigurationError(f"`hold_out` = {self.hold_out}: allowed is 0 and above")
        if self.rate_hz is not None and not 0.0 < self.rate_hz < math.inf:
            raise ConfigurationError(f"`rate_hz` = {self.rate_hz:g}: allowed is any number above 0, Hz")
        if self.input not in (None, *_INPUTS):
            raise ConfigurationError(f"`input` = {self.input!r}: allowed are {', '.join(_INPUTS)}")
        if self.scatter is not None and not set(self.scattering) <= set(_SCATTERING):
            raise ConfigurationError(f"`scatter` = {self.scatter!r}: allowed are {', '.join(_SCATTERING)}, with commas")
        if self.validation and self.hold_out:
            raise ConfigurationError("`hold_out`: is instead of `validation`; leave one of the two out")

    @property
    def scattering(self) -> tuple[str, ...]:
        """What shifts from run to run; empty if nothing does."""
        return () if self.scatter is None else tuple(name.strip() for name in self.scatter.split(","))

    @property
    def channels(self) -> dict[str, Any]:
        """Inputs and outputs in the form that `rig.measurements.experiments.experiments` takes."""
        outputs = None if self.outputs is None else [name.strip() for name in self.outputs.split(",") if name.strip()]
        return {"inputs": (self.input or "force",), "outputs": outputs}
