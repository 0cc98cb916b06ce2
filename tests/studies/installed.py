"""The distribution of studies as if it were installed: the package lies beside the product, its entry points are written."""

import os
import sys
import tomllib
from pathlib import Path

from tests.sharing import made_once, shared_folder

STUDIES = Path(__file__).parents[2] / "studies"


def entry_points() -> dict[str, dict[str, str]]:
    """The entry points that the distribution declares, by group."""
    declared: dict[str, dict[str, str]] = tomllib.loads((STUDIES / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]["entry-points"]
    return declared


def install_studies() -> None:
    """Let this process, and those that it starts, find the entry points of the studies as `pip install ./studies` would."""
    folder = str(made_once(shared_folder() / "studies", _write))
    if folder in sys.path:
        return
    sys.path.append(folder)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), folder)))


def _write(folder: Path) -> None:
    metadata = folder / "vibrolock_studies-0.1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: vibrolock-studies\nVersion: 0.1.0\n")
    lines = [
        line
        for group, entries in entry_points().items()
        for line in (f"[{group}]", *(f"{name} = {address}" for name, address in entries.items()))
    ]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")
