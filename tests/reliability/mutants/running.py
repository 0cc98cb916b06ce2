"""Judging mutants: each in a copy of the product, by tests in a process of their own, with a limit of time.

Nothing outside a temporary folder is written to: product, tests, machine code, home and temporary files of a run are in there.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from tests.reliability.mutants.choosing import Mutant, mirrored_tests
from tests.reliability.mutants.operators import changed

FATES = ("killed", "killed by time", "survived", "not covered", "not judged")
"""What becomes of a mutant: a test fails; they do not end in time; all pass; there is none; they fail without it as well."""
OPTIONS = ("-x", "-q", "-p", "no:randomly", "-p", "no:cacheprovider", "-n", "0", "-m", "not slow and not hardware")
LEFT_OUT = shutil.ignore_patterns(".git", ".venv*", ".*cache", ".hypothesis", "__pycache__", "site", "gallery", "build")
MARK = "VIBROLOCK_MUTANT"
LIMIT_S = 300.0
"""What the tests of a mutant may take, with the kernels that are compiled anew."""
MOST_MEMORY, LARGEST_FILE = 8 << 30, 2 << 30
"""Bytes, of each process."""
NO_TESTS = 5  # pytest: none was collected, or all are slow


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant."""

    fate: str
    by: str = ""
    """The test that failed first, or why the mutant was not judged."""
    took_s: float = 0.0


@dataclass(frozen=True)
class Ended:
    """How a run of tests ended."""

    status: int | None
    """Of pytest; None where it was stopped."""
    took_s: float
    output: str


class Workplace:
    """A copy of the product with tests, and everything that a run of them writes."""

    def __init__(self, folder: Path, root: Path, tests: Path, packages: Iterable[str], kernels: Path | None) -> None:
        """Copy the product at ``root``, the tests of the checkout at ``tests`` with their settings, and machine code."""
        self._folder, self.tree = folder, folder / "tree"
        shutil.copytree(root, self.tree, symlinks=True, ignore=LEFT_OUT)
        if tests != root:
            shutil.rmtree(self.tree / "tests")
            shutil.copytree(tests / "tests", self.tree / "tests", symlinks=True, ignore=LEFT_OUT)
            shutil.copy2(tests / "pyproject.toml", self.tree)
        self._kernels = folder / "kernels"
        self._kernels.mkdir()
        if kernels is not None:
            shutil.copytree(kernels, self._kernels / "vibrolock" / "kernels")
        self._passing: dict[frozenset[str], bool] = {}
        self._run((sys.executable, "-m", "compileall", "-q", *packages), LIMIT_S, self._kernels)
        self._is_used(packages)

    def _is_used(self, packages: Iterable[str]) -> None:
        """Make sure that it is the copy that tests import."""
        for package in packages:
            command = (sys.executable, "-P", "-c", f"import {package}; print({package}.__file__)")
            output = self._run(command, LIMIT_S, self._kernels).output
            if str(self.tree) not in output:
                raise RuntimeError(f"{package}: tests would import another one than the copy: {output}")

    def judge(self, mutant: Mutant, limit_s: float) -> Verdict:
        """Run the tests of a mutant; where one fails, or none ends in time, see that it is not so without the mutant."""
        tests = mirrored_tests(mutant.path, self.tree / "tests")
        if not tests:
            return Verdict("not covered", "no mirrored tests")
        try:
            other = changed((self.tree / mutant.path).read_text(encoding="utf-8"), mutant.change)
        except ValueError as error:
            return Verdict("not judged", str(error))
        kernels = self._folder / "kernels of a mutant"  # it leaves no machine code for the next one
        shutil.copytree(self._kernels, kernels)
        with self._as(mutant, other):
            ended = self._tested(tests, limit_s, kernels)
        shutil.rmtree(kernels, ignore_errors=True)
        took_s = round(ended.took_s, 1)
        if ended.status == 0:
            return Verdict("survived", "", took_s)
        if ended.status == NO_TESTS:
            return Verdict("not covered", "no quick tests", took_s)
        failed = _first_failure(ended.output)
        if ended.status is not None and self._pass_without(_tests_named_by(failed), limit_s):
            return Verdict("killed", failed, took_s)
        if not self._pass_without(tests, limit_s):
            return Verdict(
                "not judged", f"the tests fail without it or take longer than {limit_s:g} s: {failed}", took_s
            )
        return Verdict("killed", failed, took_s) if ended.status is not None else Verdict("killed by time", "", took_s)

    def _pass_without(self, tests: Sequence[str], limit_s: float) -> bool:
        """Whether tests pass without any mutant; each is asked once."""
        asked = frozenset(tests)
        if tests and asked not in self._passing:
            self._passing[asked] = self._tested(tests, limit_s, self._kernels).status == 0
        return self._passing.get(asked, False)

    @contextlib.contextmanager
    def _as(self, mutant: Mutant, other: str) -> Iterator[None]:
        """The module as another one; its bytecode, which may look as new as that, is removed."""
        file = self.tree / mutant.path
        source = file.read_text(encoding="utf-8")
        for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
            compiled.unlink()
        file.write_text(other, encoding="utf-8")
        try:
            yield
        finally:
            file.write_text(source, encoding="utf-8")

    def _tested(self, tests: Sequence[str], limit_s: float, kernels: Path) -> Ended:
        files = [f"tests/{test}" for test in tests]
        made = self._folder / "made"
        ended = self._run((sys.executable, "-m", "pytest", *OPTIONS, f"--basetemp={made}", *files), limit_s, kernels)
        shutil.rmtree(made, ignore_errors=True)
        return ended

    def _run(self, command: Sequence[str], limit_s: float, kernels: Path) -> Ended:
        """Run a command in the copy, with a home of its own; end whatever it leaves behind."""
        began_s = time.monotonic()
        with tempfile.TemporaryDirectory(dir=self._folder, prefix="run-", ignore_cleanup_errors=True) as folder:
            said = Path(folder) / "said"
            with said.open("wb") as out:
                process = subprocess.Popen(
                    command,
                    cwd=self.tree,
                    env=self._environment(Path(folder), kernels),
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            _limit(process.pid)
            status: int | None = None
            try:
                status = process.wait(limit_s)
            except subprocess.TimeoutExpired:
                pass
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                _end_those_left(folder)
            return Ended(status, time.monotonic() - began_s, said.read_text(encoding="utf-8", errors="replace"))

    def _environment(self, folder: Path, kernels: Path) -> dict[str, str]:
        (folder / "tmp").mkdir()
        (folder / "live").mkdir(mode=0o700)
        own = {
            MARK: str(folder),
            "HOME": str(folder),
            "TMPDIR": str(folder / "tmp"),
            "VIBROLOCK_LIVE": str(folder / "live"),
            "MPLCONFIGDIR": str(self._folder / "matplotlib"),
            "NUMBA_CACHE_DIR": str(kernels),
            "PYTHONPATH": str(self.tree),
            "PYTHONDONTWRITEBYTECODE": "1",  # a mutant may be as long and as new as the one before
        }
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "PYTEST_"))}
        return kept | own


def judged(
    mutants: Sequence[Mutant],
    root: Path,
    tests: Path,
    packages: Sequence[str],
    *,
    kernels: Path | None = None,
    jobs: int = 1,
    limit_s: float = LIMIT_S,
    say: Callable[[Mutant, Verdict], object] = lambda mutant, verdict: None,
) -> dict[str, Verdict]:
    """What becomes of these mutants of the product at ``root`` with the tests of the checkout at ``tests``, by name.

    ``packages``: all of the product's; ``kernels``: folder with machine code to begin with; ``limit_s``: for the tests of one
    mutant; ``say``: told of each when it is judged.
    """
    groups: dict[frozenset[str], list[Mutant]] = {}
    for mutant in mutants:
        groups.setdefault(frozenset(mirrored_tests(mutant.path, tests / "tests")), []).append(mutant)
    found = {}
    with tempfile.TemporaryDirectory(prefix="vibrolock-mutants-", ignore_cleanup_errors=True) as folder:
        free: SimpleQueue[Workplace] = SimpleQueue()
        for job in range(jobs):
            free.put(Workplace(Path(folder).resolve() / str(job), root, tests, packages, kernels))

        def judge(some: list[Mutant]) -> None:
            place = free.get()
            for mutant in some:
                found[mutant.name] = place.judge(mutant, limit_s)
                say(mutant, found[mutant.name])
            free.put(place)

        pool = ThreadPoolExecutor(jobs)
        try:
            for _ in pool.map(judge, groups.values()) if jobs > 1 else map(judge, groups.values()):
                pass
        finally:
            pool.shutdown(cancel_futures=True)
    return found


def _first_failure(output: str) -> str:
    """The line of pytest's summary on what failed first, else the last line."""
    lines = [line for line in output.splitlines() if line.strip()]
    failed = [line for line in lines if re.match("(FAILED|ERROR) tests/", line)]
    return (failed or lines[-1:] or ["no output"])[0][:400]


def _tests_named_by(failure: str) -> list[str]:
    """The test or file, below ``tests``, that a line of pytest's summary is about."""
    found = re.match(r"(?:FAILED|ERROR) tests/(.*?)(?: - |$)", failure)
    return [found[1]] if found else []


def _limit(process: int) -> None:
    """Limit memory and files of a process and of those that it starts, where the system can."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import resource

        resource.prlimit(process, resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        # Its hard limit stays: tests of full disks set limits of their own and lift them.
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.prlimit(process, resource.RLIMIT_FSIZE, (LARGEST_FILE, hard))


def _end_those_left(folder: str) -> None:
    """End processes that a run has started and left; they are known by their environment (Linux)."""
    mark = f"{MARK}={folder}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark in (process / "environ").read_bytes().split(b"\0"):
                os.kill(int(process.name), signal.SIGKILL)
