"""The list of kinds of results. A kind is declared in a folder of its name."""

from collections.abc import Iterator, Mapping
from functools import cache
from pkgutil import resolve_name
from typing import Any

from rig.results.kind import Exchange, Identification, Prediction, ResultKind
from vibrolock.on_use import Registry

KINDS: Mapping[str, ResultKind] = Registry(
    {
        name: f"rig.results.{name.replace('-', '_')}:KIND"
        for name in (
            *("nonlinear-mode", "decay-backbone", "linear-modes", "exciter", "pnlss", "structured", "force-surface"),
            *("frequency-responses", "frequency-response-matrix", "hammer-test", "measured-backbone", "time-data"),
            *("predictions", "rehearsal"),
        )
    }
)
"""Every kind of file other than recordings, by its name in the file. A declaration is imported when it is asked for."""


def all_kinds() -> Iterator[ResultKind]:
    """Yield every kind, those without a file first: of a result that is of two kinds, the first one is shown."""
    yield from resolve_name("rig.results.in_memory.kinds:KINDS")
    yield from KINDS.values()


def kind_of_result(result: object, *, stored: bool = False) -> ResultKind | None:
    """Return the kind of an object, only of those that have files if ``stored``; None if there is none."""
    names = {one.__name__ for one in type(result).__mro__}
    for kind in KINDS.values() if stored else all_kinds():
        if names & kind.type_names and isinstance(result, kind.types):
            return kind
    return None


@cache
def exchanges() -> tuple[Exchange[Any], ...]:
    """Return how each kind of object is exchanged, of all kinds that are."""
    return tuple(resolve_name(kind.exchange) for kind in all_kinds() if kind.exchange)


@cache
def identifications() -> Mapping[str, Identification]:
    """Return how models are identified, by the words for their kinds on the command line."""
    return {kind.identification.word: kind.identification for kind in KINDS.values() if kind.identification}


@cache
def predictions() -> Mapping[str, Prediction]:
    """Return how models predict, by the names of their kinds."""
    return {name: kind.prediction for name, kind in KINDS.items() if kind.prediction}
