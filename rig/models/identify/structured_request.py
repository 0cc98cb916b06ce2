"""Options for the identification of a structured model."""

from dataclasses import dataclass
from typing import Any

from rig.errors import ConfigurationError
from rig.models.identify.data_request import Options

__all__ = ["StructuredOptions"]

_LAWS = {"polynomial-spring": "springs", "polynomial-damper": "dampers"}


@dataclass(frozen=True, kw_only=True)
class StructuredOptions(Options):
    """Options of ``rig identify --model structured``. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    laws: str | None = None
    """Kinds of the laws of the element, separated by commas, such as ``polynomial-spring,polynomial-damper``."""

    def __post_init__(self) -> None:
        self.laws_to_fit  # noqa: B018 refused here, not when it is asked for

    @property
    def laws_to_fit(self) -> dict[str, Any]:
        """Laws in the form that `identification.fit_structured` takes."""
        if self.laws is None:
            return {}
        names = [name.strip() for name in self.laws.split(",")]
        if any(name not in _LAWS for name in names) or len(set(names)) < len(names):
            raise ConfigurationError(f"`laws` = {self.laws!r}: allowed are {', '.join(_LAWS)} with commas, each once")
        return {"dampers": 0} if "polynomial-damper" not in names else {}
