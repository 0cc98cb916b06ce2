"""What changed, as git knows it."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest


@dataclass(frozen=True)
class Base:
    """What is compared with: a branch's name, and the commit at which the present one left it."""

    name: str
    commit: str

    def __str__(self) -> str:
        return f"{self.name} ({self.commit[:8]})"


def _git(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)


def find_base(root: Path, asked: str = "") -> Base:
    """Return where the present branch left `main`, `main` itself left `origin/main`, or any left the one that is asked for.

    Raises `pytest.UsageError` if there is no such place.
    """
    names = [asked] if asked else ["main", "origin/main"]
    if not asked and _git(root, "symbolic-ref", "--short", "HEAD").stdout.strip() == "main":
        names.reverse()
    for name in names:
        found = _git(root, "merge-base", "HEAD", name)
        if found.returncode == 0:
            return Base(name, found.stdout.strip())
    where = "; files and folders come before --changed" if asked and (root / asked.split("::")[0]).exists() else ""
    said = (found.stderr.strip().splitlines() or ["they have nothing in common"])[0]
    raise pytest.UsageError(f"--changed: nothing to compare with: {' or '.join(names)}: {said}{where}")


def changed_files(root: Path, base: Base) -> list[str]:
    """Return the files that differ from a commit: committed since, not yet committed, untracked, or gone."""
    files: set[str] = set()
    for arguments in (
        ("diff", "--name-only", "--no-renames", "--relative", "-z", base.commit, "--"),
        ("ls-files", "--others", "--exclude-standard", "-z"),
    ):
        found = _git(root, *arguments)
        if found.returncode:
            raise pytest.UsageError(f"--changed: git {arguments[0]}: {found.stderr.strip()}")
        files |= {path for path in found.stdout.split("\0") if path}
    return sorted(files)
