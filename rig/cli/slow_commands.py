"""What a command does that may take longer than a moment, in words, for the first line of who waits for it."""

import contextlib
from collections.abc import Sequence
from contextlib import AbstractContextManager

from rig.show.waiting import Waiting

DOES = {
    "analyse": "analysing the rig",
    "check": "preparing the check",
    "conformance": "testing the driver",
    "doctor": "examining the computer",
    "export": "exporting",
    "identify": "identifying the model",
    "import": "importing",
    "plot": "drawing",
    "predict": "predicting",
    "rehearse": "preparing the rehearsal",
    "report": "writing the report",
    "reproduce": "reproducing the results",
    "resume": "preparing the run",
    "run": "preparing the run",
    "show": "reading the file",
    "tune": "preparing the test",
}
"""Commands that compute or read, and then end. Those that follow a run or ask a person are not among them."""


def waiting_for(arguments: Sequence[str]) -> AbstractContextManager[object]:
    """Return a context that says what the command in the arguments does, if it takes longer than a moment."""
    words = DOES.get(arguments[0]) if arguments else None
    if words is None or not {"-h", "--help"}.isdisjoint(arguments):
        return contextlib.nullcontext()
    return Waiting(words)
