"""What a check finds, one line for each thing that was looked at."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Verdict", "failed", "graded"]

Verdict = Literal["ok", "warn", "fail", "not tested"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    name: str
    """What: ``noise``, ``polarity`` and so on."""
    channel: str
    """The channel; empty where it concerns the whole bench."""
    verdict: Verdict
    """How it is."""
    value: float | None = None
    """The number."""
    unit: str = ""
    """Its unit."""
    allowed: str = ""
    """What it may be."""
    text: str = ""
    """What to do about it, or why it was not tested."""

    @property
    def label(self) -> str:
        """Name and channel."""
        return f"{self.name} {self.channel}".strip()


def graded(value: float, ok: tuple[float, float], tolerated: tuple[float, float]) -> Verdict:
    """``ok`` within the inner range, ``warn`` within the outer one, else ``fail``; a number that is none fails."""
    if ok[0] <= value <= ok[1]:
        return "ok"
    return "warn" if tolerated[0] <= value <= tolerated[1] else "fail"


def failed(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Labels of what failed."""
    return tuple(finding.label for finding in findings if finding.verdict == "fail")
