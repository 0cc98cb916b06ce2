"""Options for the identification of a nonlinear state-space model, and for predictions by it."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import Listed, Option
from rig.results.simulated.options import FitDataOptions, SimulatedPrediction

_OF_THE_FIT = ("states", "degrees", "output_polynomials", "saturating", "rate_hz", "input", "outputs")
"""Options that a fit which goes on has already."""


class PnlssOptions(FitDataOptions):
    """Options of ``rig identify pnlss``."""

    kind: ClassVar[str] = "pnlss"

    states: int = Field(2, ge=1)
    """Number of states, two per mode of vibration."""
    degrees: Annotated[
        tuple[Annotated[int, Field(ge=2, le=12)], ...] | None,
        Listed,
        Option(
            metavar="LIST",
            default="2,3; none beside --saturating",
            allowed='are whole numbers from 2 to 12 with commas, such as 2,3; 1 is the linear part, "" is none',
        ),
    ] = None
    """Degrees of the monomials; "" for none."""
    input: Literal["force", "voltage"] = "force"
    """Input of the model: force or voltage."""
    output_polynomials: Annotated[bool, Option(help="Keep the outputs linear in states and input.")] = True
    """Whether monomials also act on the outputs."""
    saturating: Annotated[int, Option(metavar="K")] = Field(0, ge=0)
    """Saturating features (tanh) in place of the monomials; with --degrees, beside them."""
    function: Annotated[str, Option(metavar="NAME")] = "tanh"
    """Function of the saturating features: tanh, square, cube, or MODULE:NAME of your own."""
    trust_code: bool = False
    """Import the function of --function, or those of the model that goes on."""
    constant_input: bool = False
    """Add a constant input, against offsets."""
    iterations: int = Field(1000, ge=0)
    """Largest number of iterations; the fit ends sooner if it has converged."""
    resume: Annotated[Path | None, Option(is_output=True)] = None
    """Go on with the model in OUTPUT, from the same files."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if "function" in self.model_fields_set:
            self._check_function()
        for name in _OF_THE_FIT if self.resume is not None else ():
            if name in self.model_fields_set:
                raise ConfigurationError(f"`{name}`: is set by the fit that is resumed; leave it out")
        return self

    def _check_function(self) -> None:
        from identification.models import (
            FUNCTIONS,  # only on use: nothing else here needs models
            is_users,
        )

        if not self.saturating:
            raise ConfigurationError(f"`function` = {self.function}: is of features; add `saturating`, their number")
        if self.function not in FUNCTIONS and not is_users(self.function):
            raise ConfigurationError(
                f"`function` = {self.function}: allowed are {', '.join(FUNCTIONS)}, or module:name of your own"
            )
        if is_users(self.function) and not self.trust_code:
            raise ConfigurationError(
                f"`function` = {self.function}: is code, and is not imported unless you trust it: `trust_code`"
            )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return (self.input,)

    @property
    def chosen_degrees(self) -> tuple[int, ...]:
        """Degrees in rising order; by default none if saturating features replace the monomials."""
        if self.degrees is None:
            return () if self.saturating else (2, 3)
        return tuple(sorted(set(self.degrees)))

    @property
    def saturating_features(self) -> int | tuple[int, int]:
        """Number of saturating features as `identification.identify_pnlss` takes it. Linear outputs have none of them."""
        return self.saturating if self.output_polynomials else (self.saturating, 0)


class PnlssPrediction(SimulatedPrediction):
    """Options of ``rig predict pnlss``."""

    kind: ClassVar[str] = "pnlss"
    takes: ClassVar[str] = "a PNLSS model, which answers"
