"""Tables of measured values on pages of the documentation: written between two marks, with date, machine and version."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

import vibrolock


def between(text: str, begin: str, end: str, content: str) -> str:
    """A page whose text between two marks is another; its prose stays."""
    before, rest = text.split(begin)
    return f"{before}{begin}\n\n{content.strip()}\n\n{end}{rest.split(end)[1]}"


def measured() -> str:
    """When, with what version and on what machine."""
    day = datetime.now(UTC).date().isoformat()
    return f"Measured on {day} with vibrolock {vibrolock.__version__}, {_processor()}, {os.cpu_count()} cores."


def _processor() -> str:
    """Name of the processor, as the system tells it."""
    known = Path("/proc/cpuinfo")
    lines = known.read_text(encoding="utf-8").splitlines() if known.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
