"""The result file of a test session: what was tested, with what, and what came out."""

import json
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest

__all__ = ["Results"]

PACKAGES = ("vibrolock", "numpy", "scipy", "numba", "h5py", "pyserial", "python-can", "pytest")


class Results:
    """Collects reports; ``subject`` are the facts of what is tested, empty while nothing was reached."""

    def __init__(self) -> None:
        self.subject: dict[str, Any] = {}
        self._started = datetime.now(UTC).isoformat(timespec="seconds")
        self._tests: dict[str, dict[str, Any]] = {}

    def add(self, report: pytest.TestReport) -> None:
        """One phase of a test: the worst outcome of the three counts."""
        entry = self._tests.setdefault(
            report.nodeid, {"test": report.nodeid, "outcome": "passed", "reason": "", "seconds": 0.0, "measured": {}}
        )
        entry["seconds"] += report.duration
        entry["measured"] = {str(name): value for name, value in report.user_properties}
        if report.outcome != "passed" and entry["outcome"] == "passed":
            entry["outcome"] = "error" if report.failed and report.when != "call" else report.outcome
            why = report.longrepr
            entry["reason"] = why[2] if isinstance(why, tuple) else str(why).strip().splitlines()[-1]

    def write(self, path: str, status: int) -> None:
        """Write everything as JSON."""
        document = {
            "started": self._started,
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
            "exit_status": status,
            **self.subject,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
            "versions": {name: _version(name) for name in PACKAGES},
            "tests": list(self._tests.values()),
        }
        Path(path).write_text(json.dumps(document, indent=2, default=str) + "\n", encoding="utf-8")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
