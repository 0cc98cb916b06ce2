"""Options for the identification of a structured model."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.errors import ConfigurationError
from rig.results.simulated.options import Options

if TYPE_CHECKING:
    from identification import ElementPlan
    from identification.models import Law

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

    laws: tuple[str, ...] = ()
    """Elements, each as kinds of its laws with commas: ``polynomial-spring,masing``; after ``@`` the output at which it acts,
    or two with a colon between them. One element with ``polynomial-spring,polynomial-damper`` if empty."""

    suspension_stiffness_n_m: float | None = None
    """Stiffness of the exciter's suspension, N/m, 0 for none; fitted if None."""

    def __post_init__(self) -> None:
        stiffness = self.suspension_stiffness_n_m
        if stiffness is not None and not 0.0 <= stiffness < math.inf:
            raise ConfigurationError(f"`suspension_stiffness_n_m` = {stiffness:g}: allowed is 0 and above")
        self.elements()  # refused here, not when it is asked for

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
