"""The option ``--changed`` of pytest: test files that cannot depend on what changed are not even imported."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from tests.changed.git import changed_files, find_base

ROOT = Path(__file__).parents[2]
WORKERS = "not_changed"
"""Under this name the workers of pytest-xdist get what their controller ignores."""


class Ignoring:
    """Ignores test files, and folders without any other. A file or folder that the command line names is not ignored."""

    def __init__(self, files: Iterable[str], told: str = "") -> None:
        self.files, self.told = sorted(files), told
        ignored = {ROOT / file for file in self.files}
        kept = {folder for file in all_test_files() if file not in ignored for folder in file.parents}
        self.paths = ignored | {folder for file in ignored for folder in file.parents} - kept - {*ROOT.parents, ROOT}

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Ignore what cannot depend on a change; None leaves it to others."""
        return True if collection_path in self.paths else None

    def pytest_report_header(self) -> str:
        """Say what is selected."""
        return self.told

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Hand it to a worker."""
        node.workerinput[WORKERS] = self.files


def all_test_files() -> list[Path]:
    """Return all files of tests."""
    return sorted((ROOT / "tests").rglob("test_*.py"))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption(
        "--changed",
        nargs="?",
        const="",
        metavar="REF",
        help="run only tests that can depend on what changed since this branch left REF (default: main)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Select, or take over what the controller of this worker has selected."""
    if config.getoption("changed") is None:
        return
    if hasattr(config, "workerinput"):
        config.pluginmanager.register(Ignoring(config.workerinput[WORKERS]))
        return
    base = find_base(ROOT, config.getoption("changed"))
    files = changed_files(ROOT, base)
    if not files:
        pytest.exit(f"--changed: nothing changed since {base}: no test to run", pytest.ExitCode.NO_TESTS_COLLECTED)
    config.pluginmanager.register(_ignoring(files, f"changed since {base}: {len(files)} file{'s'[: len(files) > 1]}"))


def _ignoring(files: list[str], told: str) -> Ignoring:
    """Ignore what is not selected; say how much is, or why all is."""
    from tests.changed.selection import select  # imports grimp, which no other run needs

    selection, every = select(files, ROOT), all_test_files()
    if selection.all_for:
        return Ignoring((), f"{told}; all {len(every)} test files, for {selection.all_for}")
    ignored = {file for file in every if ".".join(file.relative_to(ROOT).with_suffix("").parts) in selection.left}
    names = (file.relative_to(ROOT).as_posix() for file in ignored)
    return Ignoring(names, f"{told}; {len(every) - len(ignored)} of {len(every)} test files")
