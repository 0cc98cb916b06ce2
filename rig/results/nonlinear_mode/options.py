"""Options for the identification of a nonlinear mode, and for predictions by it."""

import math
from pathlib import Path
from typing import ClassVar, Self

from pydantic import model_validator

from rig.errors import ConfigurationError
from rig.results.options import Near, Options
from rig.results.predictions.options import Crossings, Planned, PredictionOptions, Sweeps


class NonlinearModeOptions(Options):
    """Options of ``rig identify nonlinear-mode``."""

    kind: ClassVar[str] = "nonlinear-mode"

    modes: Path | None = None
    """Linear model whose mode shapes are used."""
    near: Near = ()
    """Frequency of the mode to take from decays that hold several, Hz."""


class NonlinearModePrediction(PredictionOptions):
    """Options of ``rig predict nonlinear-mode``."""

    kind: ClassVar[str] = "nonlinear-mode"
    takes: ClassVar[str] = "a nonlinear mode, which answers"

    sweeps: Sweeps = ()
    """Predict the sweeps of this recording; may be repeated."""
    planned: Planned = ()
    """Predict the sweeps of this plan, yet to be made; may be repeated."""
    exciter: Path | None = None
    """Exciter model: sweeps are predicted from the voltage, recorded ones and planned ones."""
    zero_crossings: Crossings | None = None
    """Read an imposed force between its zero crossings, as the paper did: half-periods (all of them) or periods."""
    modes: Path | None = None
    """Linear model: other modes and other sensors."""
    allow_extrapolation: bool = False
    """Answer beyond twice the largest amplitude identified."""

    @property
    def largest_range_use(self) -> float:
        """Largest modal amplitude over the largest identified."""
        from identification.models import LARGEST_RANGE_USE  # only on use: it loads what makes machine code

        return math.inf if self.allow_extrapolation else LARGEST_RANGE_USE

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.exciter is not None and self.zero_crossings is not None:
            raise ConfigurationError(
                "`zero_crossings`: are those of an imposed force; with `exciter` the voltage is imposed"
            )
        if self.zero_crossings is not None and not self.sweeps:
            raise ConfigurationError("`zero_crossings`: is for recorded sweeps; add `sweeps`, or leave it out")
        if self.exciter is None and self.planned:
            raise ConfigurationError("`planned`: gives a voltage, which needs an exciter; add `exciter`")
        if self.exciter is not None and not (self.sweeps or self.planned):
            raise ConfigurationError(
                "`exciter`: is for sweeps, and none is given; add `sweeps` or `planned`, or leave it out"
            )
        return self
