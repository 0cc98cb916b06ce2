"""What came of a spoilt file: refused in one clear line, accepted, or neither, which is a fault of ours."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from rig.errors import RigError

LONGEST_TEXT = 1000
"""Characters of a line that refuses a file."""
LONGEST_CPU_S = 5.0
"""Of the process, so that others on the machine do not count; generous, for a legal plan may have ten thousand points."""


@dataclass(frozen=True)
class Verdict:
    """What came of one file."""

    outcome: str
    """``refused``, ``accepted``, or ``misbehaved``."""
    text: str = ""
    """The line that refused it, or what is wrong."""
    cpu_s: float = 0.0
    """What it took."""


def judged(use: Callable[[], object], allowed: tuple[type[RigError], ...]) -> Verdict:
    """Do with a file what a user does; only errors of the ``allowed`` classes are answers."""
    began = time.process_time()
    try:
        use()
        outcome, text = "accepted", ""
    except allowed as error:
        outcome, text = "refused", str(error)
    except BaseException as error:  # also what pydantic, numpy and the interpreter raise, which is the point
        if isinstance(error, KeyboardInterrupt):
            raise
        outcome, text = "misbehaved", f"unexpected {type(error).__name__}: {str(error)[:300]}"
    cpu_s = time.process_time() - began
    if cpu_s > LONGEST_CPU_S:
        return Verdict("misbehaved", f"took {cpu_s:.1f} s, then {outcome}: {text[:200]}", cpu_s)
    if outcome == "refused" and not (text.isprintable() and 0 < len(text) <= LONGEST_TEXT):
        return Verdict("misbehaved", f"refused by no clear line ({len(text)} characters): {text[:300]!r}", cpu_s)
    return Verdict(outcome, text, cpu_s)
