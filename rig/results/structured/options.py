"""Options for the identification of a structured model, and for predictions by it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import Option
from rig.results.simulated.options import FitDataOptions, SimulatedPrediction

if TYPE_CHECKING:
    from identification import ElementPlan
    from identification.models import Law


AUTO = "auto"
"""In place of laws: they are chosen (`identification.fit_structured`)."""
MODES_OF_A_STRUCTURE = (
    "the modes with which a structured model begins; make them from a test at a low level with "
    "`rig identify linear RECORDING -o MODES.h5`"
)
"""End of messages about a missing file of modes."""


class StructuredOptions(FitDataOptions):
    """Options of ``rig identify structured``."""

    kind: ClassVar[str] = "structured"

    modes: Path | None = None
    """Linear model with which the fit begins; required."""
    laws: Annotated[tuple[str, ...], Option(metavar="LIST", default="polynomial-spring,polynomial-damper")] = ()
    """Laws of an element, or auto; @OUTPUT or @OUTPUT:OUTPUT where it acts. Repeated: further elements, kept if they pay."""
    suspension_stiffness_n_m: Annotated[float | None, Option(metavar="N_PER_M", default="fitted")] = Field(None, ge=0.0)
    """Stiffness of the exciter's suspension, as in `rig show EXCITER`; 0 for none."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.modes is None:
            raise ConfigurationError(f"`modes`: is missing, {MODES_OF_A_STRUCTURE}")
        if not self.chooses():
            self.elements()  # refused here, not when it is asked for
        elif len(self.laws) > 1 or self.laws[0].partition("@")[0].strip() != AUTO:
            raise ConfigurationError(f"`laws` = {', '.join(self.laws)!r}: {AUTO} is allowed alone, for one element")
        else:
            _place(self.laws[0])
        if self.chooses() and self.scatter:
            raise ConfigurationError(
                f"`laws` = {self.laws[0]!r}: not with `scatter`; choose without it, then name the laws"
            )
        return self

    def chooses(self) -> bool:
        """Whether laws are chosen."""
        return any(name.strip() == AUTO for text in self.laws for name in text.partition("@")[0].split(","))

    def arguments(self) -> dict[str, Any]:
        """Return what `identification.fit_structured` takes."""
        if not self.chooses():
            return {"elements": self.elements()}
        return {"laws": AUTO, "between": _place(self.laws[0])}

    def elements(self) -> "tuple[ElementPlan, ...]":
        """Return the elements as `identification.fit_structured` takes them."""
        if not self.laws:
            return ()
        from identification import ElementPlan
        from identification.models import LAWS

        ready: dict[str, type[Law]] = {name: law for name, law in LAWS.items() if name != "user-spring"}
        found = []
        for text in self.laws:
            names = [name.strip() for name in text.partition("@")[0].split(",")]
            if any(name not in ready for name in names) or len(set(names)) < len(names):
                raise ConfigurationError(
                    f"`laws` = {text!r}: allowed are {', '.join(ready)}, each once, with commas, or {AUTO}"
                )
            found.append(ElementPlan(tuple(ready[name]() for name in names), _place(text)))
        return tuple(found)


def _place(text: str) -> tuple[str, ...]:
    """Return the outputs after @."""
    _, at, place = text.partition("@")
    between = tuple(name.strip() for name in place.split(":")) if at else ()
    if not all(between) or len(between) > 2 or len(set(between)) < len(between):
        raise ConfigurationError(f"`laws` = {text!r}: after @ allowed is an output, or two with a colon between them")
    return between


class StructuredPrediction(SimulatedPrediction):
    """Options of ``rig predict structured``."""

    kind: ClassVar[str] = "structured"
    takes: ClassVar[str] = "a structured model, which answers"

    bands: bool = False
    """Give predictions 95 % bands, from models that the fit allows and laws that fit as well; in the time of 26 to 46."""
    allow_extrapolation: bool = False
    """Permit predictions beyond the training data without a band, which otherwise have one or are refused."""
