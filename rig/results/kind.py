"""Declaration of a kind of result: all that the program knows of it. What it needs is named by an address, imported on use."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from rig.drawing.style import Figure

if TYPE_CHECKING:
    from identification import FitProgress, Predictions
    from identification.common import Arrays, Attributes
    from rig.drawing.curves import Curves, View
    from rig.results.options import Options
    from rig.text.contents import Contents

Progress = Callable[["FitProgress"], None]
"""Is called after every iteration of a fit."""
T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True)
class Storage(Generic[T]):
    """How a result is stored."""

    pack: "Callable[[T], tuple[Arrays, Attributes]]"
    """Converts a result to arrays and JSON-able attributes."""
    unpack: "Callable[[Arrays, Attributes], T]"
    """Converts arrays and attributes back; raises `IdentificationError` if something is missing."""


@dataclass(frozen=True)
class Table(Generic[T, S]):
    """How a result is shown in text."""

    summarise: Callable[[T], S]
    """Returns what ``rig show --json`` prints, without the kind."""
    say: Callable[[S], None]
    """Prints such a summary for a person."""


@dataclass(frozen=True)
class Exchange(Generic[T]):
    """How an object is exchanged with other programs."""

    name: str
    """Name in exchanged files."""
    type: type[T]
    """Type of the object."""
    apart: "Callable[[T], Contents]"
    """Converts the object to arrays and attributes."""
    together: "Callable[[Arrays, Attributes], T]"
    """Converts them back."""


class Remark(NamedTuple):
    """What the user is told of how an identification ended."""

    text: str
    unfinished: bool = False
    """Whether it was interrupted."""


class _WithOptions:
    """Has the address of a class of options."""

    options_address: str

    @property
    def options(self) -> "type[Options]":
        """Class of its options."""
        options: type[Options] = resolve_name(self.options_address)
        return options


@dataclass(frozen=True)
class Identification(_WithOptions):
    """How such models are identified by ``rig identify``."""

    word: str
    """Word for the kind on the command line."""
    text: str
    """What is identified, and from what; one sentence of the help."""
    options_address: str
    """Address of the class of its options."""
    identify_address: str
    """Address of the function that identifies, ``(paths, options, progress)``."""
    remark_address: str = ""
    """Address of the function that returns what the user is told of how it ended, ``(result, path)``; empty: nothing."""

    def remark(self, result: object, path: Path) -> "Remark | None":
        """Return what the user is told of how the identification ended."""
        told: Remark | None = resolve_name(self.remark_address)(result, path) if self.remark_address else None
        return told

    def identify(self, paths: Sequence[Path], options: "Options", progress: Progress | None = None) -> Any:
        """Identify a model in files; ``progress`` is called after every iteration of a fit."""
        return resolve_name(self.identify_address)(paths, options, progress)


@dataclass(frozen=True)
class Prediction(_WithOptions):
    """How such models predict by ``rig predict``."""

    text: str
    """What is predicted; one sentence of the help."""
    options_address: str
    """Address of the class of its options."""
    predict_address: str
    """Address of the function that predicts with the model in a file, ``(path, options)``."""

    def predict(self, model: Path, options: "Options") -> "Predictions":
        """Predict with the model in a file."""
        found: Predictions = resolve_name(self.predict_address)(model, options)
        return found


@dataclass(frozen=True, kw_only=True)
class ResultKind:
    """One kind of result. It is declared in its own folder and listed in `rig.results.kinds`.

    An address is ``module:object``. It is resolved when the object is used, so that a declaration costs nothing.
    """

    name: str
    """Name in the file; for a person where there is no file."""
    holds: tuple[str, ...]
    """Addresses of the types of its objects; the first is the one that is loaded from a file."""
    stored: bool = True
    """Whether such results have files."""
    storage: str = ""
    """Address of its `Storage`; empty: that of `identification.storage`."""
    whole: str = ""
    """Address of the function that makes an object of the first type from one of the others."""
    table: str
    """Address of its `Table`, or of the function that prints a result for which there is no summary."""
    draw: str
    """Address of the function that draws a result on an empty page, ``(page, result)``."""
    figure_in: tuple[float, float] = (9.0, 6.4)
    """Width and height of the page, inches."""
    curves: Mapping[str, str] = field(default_factory=dict)
    """By the family of curves that can be laid over those of other files: address of the function that returns them,
    ``(result, view)``; of several families, it returns None where the result does not have them."""
    exchange: str = ""
    """Address of its `Exchange`; empty: such objects are not exchanged."""
    identification: Identification | None = None
    """How it is identified; None if it is not."""
    prediction: Prediction | None = None
    """How it predicts; None if it does not."""
    exported: str = ""
    """Address of the function that returns the objects of a result that are exported; empty: the result itself."""

    @property
    def types(self) -> tuple[type, ...]:
        """Types of its objects."""
        return tuple(resolve_name(address) for address in self.holds)

    @property
    def type_names(self) -> set[str]:
        """Names of these types; they are not imported."""
        return {address.rpartition(":")[2] for address in self.holds}

    def loads(self, wanted: type) -> bool:
        """Return whether objects of a type are loaded from such files; the type of the kind is not imported."""
        return self.holds[0].rpartition(":")[2] == wanted.__name__

    def _storage(self) -> Storage[Any]:
        if self.storage:
            stored: Storage[Any] = resolve_name(self.storage)
            return stored
        from identification.common import decode, encode

        return Storage(encode, partial(decode, self.types[0]))

    def _table(self) -> Table[Any, Any]:
        found = resolve_name(self.table)
        return found if isinstance(found, Table) else Table(lambda result: result, found)

    def pack(self, result: object) -> "tuple[Arrays, Attributes]":
        """Convert a result to arrays and JSON-able attributes."""
        return self._storage().pack(self.as_kept(result))

    def unpack(self, arrays: "Arrays", attributes: "Attributes") -> Any:
        """Convert arrays and attributes back to the result."""
        return self._storage().unpack(arrays, attributes)

    def as_kept(self, result: object) -> Any:
        """Return the result as it would be loaded from its file: linear modes as a modal analysis, for example."""
        return result if not self.whole or isinstance(result, self.types[0]) else resolve_name(self.whole)(result)

    def summarise(self, result: object) -> Any:
        """Return the summary of a result."""
        return self._table().summarise(result)

    def say(self, summary: Any) -> None:
        """Print a summary for a person."""
        self._table().say(summary)

    def draw_on(self, page: Figure, result: object) -> None:
        """Draw a result on an empty page."""
        resolve_name(self.draw)(page, self.as_kept(result))

    def families(self, load: Callable[[], object]) -> tuple[str, ...]:
        """Return the families of curves of a result, which is loaded if the kind has several."""
        if len(self.curves) < 2:
            return tuple(self.curves)
        from rig.drawing.curves import View

        result = load()
        return tuple(family for family, address in self.curves.items() if resolve_name(address)(result, View()))

    def curves_of(self, result: object, family: str, view: "View") -> "Curves":
        """Return the curves of a result that are of a family which it has."""
        found: Curves = resolve_name(self.curves[family])(result, view)
        return found

    def objects_of(self, result: object) -> list[Any]:
        """Return the objects of a result that are exported."""
        return list(resolve_name(self.exported)(result)) if self.exported else [result]
