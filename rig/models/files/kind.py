"""Description of a kind of file other than recordings: everything that the program needs to know about the kind."""

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
    """Type of the object in the file."""
    pack: Callable[[Any], tuple[Arrays, Attributes]]
    """Converts the object to arrays and JSON-able attributes."""
    unpack: Callable[[Arrays, Attributes], Any]
    """Converts arrays and attributes back to the object; raises `IdentificationError` if something is missing."""
    summarise: Callable[[Any], dict[str, Any]]
    """Returns the dictionary that ``rig show --json`` prints, without the kind."""
    say: Callable[[dict[str, Any]], None]
    """Prints a summary for a person."""
    draw: str
    """``module:function`` that draws the object on an empty page, ``(page, object)``. It is imported only when a figure is
    drawn."""
    figure_in: tuple[float, float] = (9.0, 6.4)
    """Width and height of the page, inches."""
