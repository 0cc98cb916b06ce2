"""Options of models that are simulated: for the data that they are fitted to, and for predictions."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import Listed, Names, Option, Options
from rig.results.predictions.options import Levels, Planned, PredictionOptions, Sweeps

RunEffect = Literal["frequency", "damping", "gain"]


class FitDataOptions(Options):
    """Which data a model is fitted to and judged by."""

    rate_hz: Annotated[
        float | None,
        Option(
            metavar="HZ",
            default="25 per period of the highest frequency",
            allowed="is any number above 0, Hz",
        ),
    ] = Field(None, gt=0.0)
    """Sample rate of the model."""
    outputs: Annotated[Names | None, Option(default="all motions")] = None
    """Outputs of the model."""
    validation: tuple[Path, ...] = ()
    """Recording by which the model is judged; may be repeated."""
    hold_out: Annotated[int | None, Option(default="1", allowed="is 0 and above")] = Field(None, ge=0)
    """Hold out the last N realisations of each level for validation; with five or more settled points, also every fourth."""
    relative: Annotated[bool, Option(flag="--relative-errors")] = False
    """Weight experiments by their outputs: small levels count as much as large ones."""
    scatter: Annotated[
        tuple[RunEffect, ...],
        Listed,
        Option(metavar="LIST", default="nothing", allowed="are frequency, damping, gain, with commas"),
    ] = ()
    """What shifts from one recording to the next: frequency, damping, gain."""

    @model_validator(mode="after")
    def _check_validation(self) -> Self:
        if self.validation and self.hold_out:
            raise ConfigurationError("`hold_out`: is instead of `validation`; leave one of the two out")
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return ("force",)


class SimulatedPrediction(PredictionOptions):
    """Options of predictions by a PNLSS or structured model. By default a model driven by a force holds a pure sine."""

    voltages_v: Annotated[
        Levels, Option(flag="--voltage-response", metavar="VOLT", allowed="is any number above 0, V")
    ] = ()
    """Predict the frequency response at this constant voltage (peak), of its input or of the exciter; may be repeated."""
    sweeps: Sweeps = ()
    """Predict the sweeps of this recording; may be repeated."""
    multisines: Annotated[tuple[Path, ...], Option(flag="--multisine")] = ()
    """Simulate the realisations of this recording; may be repeated."""
    planned: Planned = ()
    """Predict the sweeps of this plan, yet to be made; may be repeated."""
    planned_multisines: Annotated[tuple[str, ...], Option(flag="--planned-multisine", metavar="PLAN")] = ()
    """Simulate the multisines of this plan, yet to be made; may be repeated."""
    constants: Annotated[tuple[str, ...], Option(flag="--constant", metavar="NAME=VALUE")] = ()
    """Hold this input at a value; may be repeated. That of --constant-input holds by itself."""
    exciter: Path | None = None
    """Exciter model that drives a model whose input is the force, with the harmonics that it makes."""
    trust_code: bool = False
    """Import the functions that the model names."""
