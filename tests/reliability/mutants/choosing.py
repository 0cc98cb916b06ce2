"""Which mutants are made, and which tests judge one of them.

A seed and the name of a mutant give its rank, and the first ones of each package are chosen. So the mutants of a short run are
among those of a long one, and an edit of the product changes no others than its own.
"""

import hashlib
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from tests.reliability.mutants.operators import Change, changes

PACKAGES = ("rig", "controller", "simulators", "identification", "vibrolock", "studies")
EQUIVALENT: dict[str, str] = tomllib.loads(Path(__file__).with_name("equivalent.toml").read_text(encoding="utf-8"))
"""Names of mutants that mean the same as the product, and the reason."""
LEAST = 20
"""A package has one mutant of so many at least, if it has that many."""
ELSEWHERE = {
    "rig/campaigns/sweep": ("rig/campaigns", "rig/campaigns/running"),
    "rig/conformance": ("contract",),
    "rig/exchange/foreign": ("rig/exchange/time_data",),
    "rig/exchange/proposal": ("rig/exchange/time_data",),
    "rig/hil": ("hardware",),
    "rig/wire": ("rig/wire/serial", "rig/wire/can"),
    "simulators/plant": ("simulators", "simulators/sites"),
}
"""Folders of the product whose tests stand neither in a folder of their name nor, all of them, in the one above it."""


class Mutant(NamedTuple):
    """A changed expression of a module."""

    path: str
    """Module below the root, with slashes."""
    change: Change
    occurrence: int
    """From 1; the same change may be made in several statements of a function that read alike."""

    @property
    def package(self) -> str:
        """The package that it belongs to."""
        return self.path.split("/")[0]

    @property
    def name(self) -> str:
        """The same as long as function and statement are; line numbers do not count."""
        one = self.change
        which = f" ({self.occurrence})" if self.occurrence > 1 else ""
        return f"{self.path}::{one.function}: {one.before} -> {one.after}{which}"


def mutants_of(root: Path, path: str) -> list[Mutant]:
    """Every mutant of a module, in the order of its text."""
    seen: Counter[tuple[str, str, str]] = Counter()
    found = []
    for change in changes((root / path).read_text(encoding="utf-8")):
        alike = change.function, change.before, change.after
        seen[alike] += 1
        found.append(Mutant(path, change, seen[alike]))
    return found


def shares(sizes: dict[str, int], number: int) -> dict[str, int]:
    """How many of so many mutants each package gets: in proportion to its own, but one of `LEAST` at least."""
    number = min(number, sum(sizes.values()))
    fixed: dict[str, int] = {}
    while True:
        free = {package: size for package, size in sizes.items() if package not in fixed}
        left, total = number - sum(fixed.values()), max(1, sum(free.values()))
        few = {p: min(size, max(1, number // LEAST)) for p, size in free.items()}
        few = {p: least for p, least in few.items() if left * free[p] / total < least}
        if not few:
            break
        fixed |= few
    found = {package: left * size // total for package, size in free.items()}
    by_rest = sorted(free, key=lambda package: (-(left * free[package] % total), package))
    for package in by_rest[: left - sum(found.values())]:
        found[package] += 1
    return {package: (fixed | found)[package] for package in sizes}


def chosen(root: Path, packages: Sequence[str], number: int, seed: int) -> list[Mutant]:
    """So many mutants of these packages, the same ones for the same seed and product; by package, module and line."""
    every = {package: _of_package(root, package) for package in packages}
    wanted = shares({package: len(some) for package, some in every.items()}, number)
    found = []
    for package, some in every.items():
        ranked = sorted(some, key=lambda one: hashlib.sha256(f"{seed} {one.name}".encode()).digest())
        found += sorted(ranked[: wanted[package]], key=lambda one: (one.path, one.change.begin, one.change.text))
    return found


def _of_package(root: Path, package: str) -> list[Mutant]:
    paths = sorted(path.relative_to(root).as_posix() for path in (root / package).rglob("*.py"))
    return [mutant for path in paths for mutant in mutants_of(root, path)]


def mirrored_tests(path: str, tests: Path) -> tuple[str, ...]:
    """The tests that judge a module, below the folder of ``tests``, those first that are the most likely to notice.

    They are those of the folder that mirrors the module's, without folders below, or else of the next one above. A module's own
    tests (``test_<module>.py``, then ``test_<folder>.py``) come first, then those that name it. No file takes the place of
    another, so that tests which somebody adds can only kill more.
    """
    module = PurePosixPath(path)
    files = sorted(_files(module.parent, tests))
    own = [f"test_{module.stem}.py", f"test_{module.parent.name}.py"]
    dotted = ".".join((*module.parent.parts, module.stem))

    def rank(file: Path) -> tuple[int, bool]:
        named = dotted in file.read_text(encoding="utf-8")
        return own.index(file.name) if file.name in own else len(own), not named

    return tuple(file.relative_to(tests).as_posix() for file in sorted(files, key=rank))


def _files(folder: PurePosixPath, tests: Path) -> list[Path]:
    if str(folder) in ELSEWHERE:
        return [file for other in ELSEWHERE[str(folder)] for file in (tests / other).glob("test_*.py")]
    found = [*(tests / folder).glob("test_*.py")]
    return found if found or len(folder.parts) == 1 else _files(folder.parent, tests)
