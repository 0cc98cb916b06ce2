"""What a file that is no recording may hold: one description per kind, and everything that is asked of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

if TYPE_CHECKING:
    pass

__all__ = ["Arrays", "Attributes", "FileKind"]

Arrays = Mapping[str, NDArray[Any]]
Attributes = Mapping[str, Any]


@dataclass(frozen=True)
class FileKind:
    """One kind of file."""

    name: str
    """Name in the file."""
    holds: type
    """Type of what is in it."""
    pack: Callable[[Any], tuple[Arrays, Attributes]]
    """From the object to arrays and JSON-able attributes."""
    unpack: Callable[[Arrays, Attributes], Any]
    """The inverse; `IdentificationError` where something is missing."""
    summarise: Callable[[Any], dict[str, Any]]
    """What ``rig show --json`` prints, without the kind."""
    say: Callable[[dict[str, Any]], None]
    """Print a summary for a person."""
    draw: str
    """``module:function`` that draws the object on an empty page, ``(page, object)``; loaded when a figure is wanted."""
    figure_in: tuple[float, float] = (9.0, 6.4)
    """Width and height of the page, inches."""
