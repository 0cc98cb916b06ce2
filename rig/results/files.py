"""Save models, predictions and imported measurements in files, and load them again."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

from numpy.exceptions import ComplexWarning

from rig.errors import RecordingError
from rig.recording.arrays import kind_of, read_arrays, write_arrays
from rig.results.kinds import KINDS, kind_of_result
from vibrolock.printable import error_text

T = TypeVar("T")

_MISFITS = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError)


def save(result: object, path: Path) -> None:
    """Write a model, a prediction or an imported measurement. The file is written completely or not at all.

    Linear modes without responses are written as a modal analysis. A fit or a model without further results is written as an
    identified PNLSS model.
    """
    kind = kind_of_result(result, stored=True)
    if kind is None:
        raise RecordingError(f"{path}: a {type(result).__name__} has no file of its own; known are {', '.join(KINDS)}")
    write_arrays(path, kind.name, *kind.pack(result))


def load(path: Path) -> Any:
    """Return the object that `save` wrote; raise `RecordingError` if the file is a recording or damaged."""
    name, arrays, attributes = read_arrays(path)
    if name not in KINDS:
        raise RecordingError(f"{path}: is a file of kind {name}; known are {', '.join(KINDS)}")
    with understood(path, name):
        return KINDS[name].unpack(arrays, attributes)


@contextmanager
def understood(path: Path, kind: str) -> Iterator[None]:
    """Convert errors due to missing arrays, wrong shapes or types in a file to one `RecordingError` that names the file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ComplexWarning)  # an imaginary part must not be dropped silently
            yield
    except (*_MISFITS, ComplexWarning) as error:
        raise RecordingError(f"{path}: does not hold what makes a {kind} ({error_text(error)})") from error


def load_as(wanted: type[T], path: Path) -> T:
    """Load a file whose kind loads objects of a type; raise `RecordingError` for a file of another kind."""
    name = next(name for name, kind in KINDS.items() if kind.loads(wanted))
    found = kind_of(path)
    if found != name:
        raise RecordingError(f"{path}: is a file of kind {found}, expected one of kind {name}")
    return cast(T, load(path))
