"""Files of rehearsals: every draw with its unknowns, its end, its points and its harmonic balance."""

from typing import Any

from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.report import Summary, lines, summary
from rig.results.kind import Table


def _say(found: dict[str, Any]) -> None:
    """Print the page; the specimen stands above it."""
    for line in lines(Summary.model_validate(found)):
        print(line)


def _summarise(rehearsal: Rehearsal) -> dict[str, Any]:
    return summary(rehearsal).model_dump(by_alias=True)


TABLE = Table(_summarise, _say)
