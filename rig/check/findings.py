"""`Finding`: the result of one test of a check."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Verdict", "failed", "graded"]

Verdict = Literal["ok", "warn", "fail", "not tested"]


@dataclass(frozen=True)
class Finding:
    """The result of one test."""

    name: str
    """Name of the test: ``noise``, ``polarity`` and so on."""
    channel: str
    """The channel; empty if the test is of the whole bench."""
    verdict: Verdict
    """The verdict."""
    value: float | None = None
    """The measured value."""
    unit: str = ""
    """Its unit."""
    allowed: str = ""
    """The allowed range, in words."""
    text: str = ""
    """What to do about it, or why it was not tested."""

    @property
    def label(self) -> str:
        """Name and channel."""
        return f"{self.name} {self.channel}".strip()


def graded(value: float, ok: tuple[float, float], tolerated: tuple[float, float]) -> Verdict:
    """``ok`` within the inner range, ``warn`` within the outer one, else ``fail``; NaN fails."""
    if ok[0] <= value <= ok[1]:
        return "ok"
    return "warn" if tolerated[0] <= value <= tolerated[1] else "fail"


def failed(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Labels of the findings that failed."""
    return tuple(finding.label for finding in findings if finding.verdict == "fail")
