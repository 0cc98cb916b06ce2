"""Options for the identification of a structured model."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError
from rig.models.identify.data_request import Options

if TYPE_CHECKING:
    from identification.structured.laws import Law

__all__ = ["MODES_OF_A_STRUCTURE", "StructuredOptions"]

MODES_OF_A_STRUCTURE = (
    "the modes with which a structured model begins; make them from a test at a low level with "
    "`rig identify RECORDING --model linear -o MODES.h5`"
)
"""End of messages about a missing file of modes."""


@dataclass(frozen=True, kw_only=True)
class StructuredOptions(Options):
    """Options of ``rig identify --model structured``. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    laws: str | None = None
    """Kinds of the laws of the element, separated by commas; ``polynomial-spring,polynomial-damper`` if None."""

    def __post_init__(self) -> None:
        self.for_fit()  # refused here, not when it is asked for

    def for_fit(self) -> dict[str, Any]:
        """Return what `identification.fit_structured` takes."""
        if self.laws is None:
            return {}
        from identification.structured.laws import LAWS

        names = [name.strip() for name in self.laws.split(",")]
        ready: dict[str, type[Law]] = {name: law for name, law in LAWS.items() if name != "user-spring"}
        if any(name not in ready for name in names) or len(set(names)) < len(names):
            raise ConfigurationError(f"`laws` = {self.laws!r}: allowed are {', '.join(ready)}, each once, with commas")
        return {"laws": tuple(ready[name]() for name in names)}
