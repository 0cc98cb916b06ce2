"""The list of kinds of results. A kind is declared in a folder of its name; here is one line for each."""

from collections.abc import Iterator, Mapping
from functools import cache
from pkgutil import resolve_name
from typing import Any

from rig.results.kind import Exchange, Identification, Prediction, ResultKind
from vibrolock.on_use import Registry

KINDS: Mapping[str, ResultKind] = Registry(
    {
        "nonlinear-mode": "rig.results.nonlinear_mode:KIND",
        "decay-backbone": "rig.results.decay_backbone:KIND",
        "linear-modes": "rig.results.linear_modes:KIND",
        "exciter": "rig.results.exciter:KIND",
        "pnlss": "rig.results.pnlss:KIND",
        "structured": "rig.results.structured:KIND",
        "force-surface": "rig.results.force_surface:KIND",
        "frequency-responses": "rig.results.frequency_responses:KIND",
        "frequency-response-matrix": "rig.results.frequency_response_matrix:KIND",
        "hammer-test": "rig.results.hammer_test:KIND",
        "measured-backbone": "rig.results.measured_backbone:KIND",
        "time-data": "rig.results.time_data:KIND",
        "predictions": "rig.results.predictions:KIND",
        "rehearsal": "rig.results.rehearsal:KIND",
    }
)
"""Every kind of file other than recordings, by its name in the file. A declaration is imported when it is asked for."""

_IN_MEMORY = "rig.results.in_memory.kinds:KINDS"
"""Address of the kinds of results that have no file."""


def all_kinds() -> Iterator[ResultKind]:
    """Yield every kind, those without a file first: of a result that is of two kinds, the first one is shown."""
    yield from resolve_name(_IN_MEMORY)
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
