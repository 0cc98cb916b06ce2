"""Options for the identification of a structured model, and for predictions by it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from rig.errors import ConfigurationError
from rig.results.options import Option
from rig.results.simulated.options import FitDataOptions, SimulatedPrediction

if TYPE_CHECKING:
    from identification import ElementPlan
    from identification.models import Law


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
    """Laws of an element, with @OUTPUT or @OUTPUT:OUTPUT where it acts; repeated for further elements, kept if they pay."""
    suspension_stiffness_n_m: Annotated[float | None, Option(metavar="N_PER_M", default="fitted")] = Field(None, ge=0.0)
    """Stiffness of the exciter's suspension, as in `rig show EXCITER`; 0 for none."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.modes is None:
            raise ConfigurationError(f"`modes`: is missing, {MODES_OF_A_STRUCTURE}")
        self.elements()  # refused here, not when it is asked for
        return self

    def elements(self) -> "tuple[ElementPlan, ...]":
        """Return the elements as `identification.fit_structured` takes them."""
        if not self.laws:
            return ()
        from identification import ElementPlan
        from identification.models import LAWS

        ready: dict[str, type[Law]] = {name: law for name, law in LAWS.items() if name != "user-spring"}
        found = []
        for text in self.laws:
            kinds, at, place = text.partition("@")
            names, between = [name.strip() for name in kinds.split(",")], [name.strip() for name in place.split(":")]
            if any(name not in ready for name in names) or len(set(names)) < len(names):
                raise ConfigurationError(f"`laws` = {text!r}: allowed are {', '.join(ready)}, each once, with commas")
            if at and (not all(between) or len(between) > 2 or len(set(between)) < len(between)):
                raise ConfigurationError(
                    f"`laws` = {text!r}: after @ allowed is an output, or two with a colon between them"
                )
            found.append(ElementPlan(tuple(ready[name]() for name in names), tuple(between) if at else ()))
        return tuple(found)


class StructuredPrediction(SimulatedPrediction):
    """Options of ``rig predict structured``."""

    kind: ClassVar[str] = "structured"
    takes: ClassVar[str] = "a structured model, which answers"

    bands: bool = False
    """Give the responses 95 % bands, from 40 models that the fit allows; takes as long as 40 responses."""
