"""Description of a kind of file other than recordings: everything that the program needs to know about the kind."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]
Attributes = Mapping[str, Any]


@dataclass(frozen=True)
class FileKind:
    """One kind of file."""

    name: str
    """Name in the file."""
    holds: type | tuple[type, ...]
    """Types of the objects that are saved in such a file; the first is the one that is loaded."""
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
