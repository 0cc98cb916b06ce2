"""The result file of a test session: what was tested, with what, and what came out."""

import json
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest

PACKAGES = ("vibrolock", "numpy", "scipy", "numba", "h5py", "pyserial", "python-can", "pytest")


class Results:
    """A plug-in that collects the reports of all processes; without facts of a bench where none was reached."""

    def __init__(self, path: str) -> None:
        self._path = Path(path).absolute()
        if self._path.exists() and not _is_result(self._path):
            raise pytest.UsageError(
                f"--rig-result {path}: exists already and is not such a result; choose another name"
            )
        self._subject: dict[str, object] = {}
        self._started = datetime.now(UTC).isoformat(timespec="seconds")
        self._tests: dict[str, dict[str, Any]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """One phase of a test: the worst outcome of the three counts."""
        self._subject = getattr(report, "rig_facts", self._subject)
        entry = self._tests.setdefault(
            report.nodeid, {"test": report.nodeid, "outcome": "passed", "reason": "", "seconds": 0.0, "measured": {}}
        )
        entry["seconds"] += report.duration
        entry["measured"] = {str(name): value for name, value in report.user_properties}
        if report.outcome != "passed" and entry["outcome"] == "passed":
            entry["outcome"] = "error" if report.failed and report.when != "call" else report.outcome
            entry["reason"] = _reason(report.longrepr)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write everything as JSON."""
        document = {
            "started": self._started,
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
            "exit_status": int(session.exitstatus),
            **self._subject,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
            "versions": {name: _version(name) for name in PACKAGES},
            "tests": list(self._tests.values()),
        }
        self._path.write_text(json.dumps(document, indent=2, default=str) + "\n", encoding="utf-8")


def _is_result(path: Path) -> bool:
    try:
        return {"exit_status", "tests"} <= dict(
            json.loads(path.read_bytes() or b'{"exit_status": 0, "tests": []}')
        ).keys()
    except (OSError, ValueError, TypeError, RecursionError):
        return False


def _reason(why: object) -> str:
    """One line: what a skip says, what an exception says, or all there is."""
    if isinstance(why, tuple):
        return str(why[2])
    crash = getattr(why, "reprcrash", None)
    return str(why if crash is None else crash.message).strip().partition("\n")[0]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
