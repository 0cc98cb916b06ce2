"""The result of one test of a check, and which recordings are those of a check."""

from dataclasses import dataclass
from typing import Literal

from rig.recording.reader import Recording

Verdict = Literal["ok", "warn", "fail", "not tested"]


@dataclass(frozen=True)
class Finding:
    """The result of one test."""

    name: str
    """Name of the test: ``noise``, ``polarity`` and so on."""
    channel: str
    """The channel; empty if the test concerns the whole bench."""
    verdict: Verdict
    """The verdict."""
    value: float | None = None
    """The measured value."""
    unit: str = ""
    """Unit of the value."""
    allowed: str = ""
    """The allowed range, in words."""
    text: str = ""
    """What to do about it, or why it was not tested."""

    @property
    def label(self) -> str:
        """Name and channel of the finding."""
        return f"{self.name} {self.channel}".strip()


def not_tested(name: str, text: str, channel: str = "") -> Finding:
    """Return the finding that something was not tested, and why."""
    return Finding(name, channel, "not tested", text=text)


def graded(value: float, ok: tuple[float, float], tolerated: tuple[float, float]) -> Verdict:
    """Return ``ok`` within the inner range, ``warn`` within the outer range, otherwise ``fail``; NaN fails."""
    if ok[0] <= value <= ok[1]:
        return "ok"
    return "warn" if tolerated[0] <= value <= tolerated[1] else "fail"


PURPOSE = "check"  # purpose of the recording of a check, in the facts of its parts


def is_check(recording: Recording) -> bool:
    """Return whether a recording is that of a check."""
    return bool(recording.parts) and recording.parts[0].information.get("about", {}).get("purpose") == PURPOSE
