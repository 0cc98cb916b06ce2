"""Go through all places, and print what was wrong.

``python -m tests.reliability.places [--jobs 2]``
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.reliability.places.scenes import SCENES


def gone_through(jobs: int) -> dict[str, list[str]]:
    """What was wrong in every scene."""
    with ProcessPoolExecutor(jobs) as pool:
        return dict(zip(SCENES, pool.map(_scene, SCENES), strict=True))


def _scene(name: str) -> list[str]:
    with tempfile.TemporaryDirectory(prefix="vibrolock-place-") as folder:
        return SCENES[name](Path(folder))


def table(found: Mapping[str, list[str]]) -> list[str]:
    """Scenes as a table."""
    lines = ["| scene | wrong |", "|---|---|"]
    return lines + [f"| {name.replace('|', ' ')} | {len(wrong) or '-'} |" for name, wrong in found.items()]


def main() -> int:
    """Go, and print."""
    parser = argparse.ArgumentParser(
        description="Runs where disk, folder, name, locale or clock are not as they should be."
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    found = gone_through(parser.parse_args().jobs)
    for name, wrong in found.items():
        for line in wrong:
            print(f"{name}: {line}")
    print("\n".join(table(found)))
    return int(any(found.values()))


if __name__ == "__main__":
    sys.exit(main())
