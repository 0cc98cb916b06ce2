"""The checks of the firmware's core in short: fuzzing, branch coverage, static analysis, both compilers."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.building import FOLDER, built_tick

CHECKS_S = 500.0
RUNS = 10_000
"""Inputs in all; the long run has ten million."""
REQUESTS = 5000
LEAST_BRANCHES = 83.0
"""Per cent, with so few requests and inputs; those of the long run are at least 95. Some are a loop's, which is not linked."""


LEAST_BRANCHES_OF_LOOP = 70.0
"""The same of the loop's part of the core; of the long run 85."""


def _needs(*programs: str) -> None:
    """Skip where a program is missing; with ``VIBROLOCK_FIRMWARE=required``, fail."""
    missing = [name for name in programs if shutil.which(name) is None]
    if not missing:
        return
    why = f"the check needs {' and '.join(missing)}"
    if os.environ.get("VIBROLOCK_FIRMWARE") == "required":
        pytest.fail(why)
    pytest.skip(why)


def _make(target: str, build: Path, **variables: object) -> str:
    command = ["make", "-C", str(FOLDER), f"BUILD={build}", *(f"{name}={value}" for name, value in variables.items())]
    done = subprocess.run([*command, target], capture_output=True, text=True, timeout=CHECKS_S, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said[-6000:]
    return said


def _python() -> str:
    """This interpreter, with this tree's packages wherever make is."""
    return f"env PYTHONPATH={FOLDER.parent} {sys.executable}"


@pytest.mark.slow
def test_the_fuzzer_finds_nothing(tmp_path: Path) -> None:
    _needs("make", "clang")
    said = _make("fuzz", tmp_path, RUNS=RUNS, SEED=1)
    assert re.findall(r"Done (\d+) runs", said) == [str(2 * RUNS // 5), str(RUNS // 5), str(2 * RUNS // 5)]
    reached = [int(found) for found in re.findall(r"DONE +cov: (\d+)", said)]
    assert min(reached) > 250  # edges: it comes beyond the frames, to states and streams


@pytest.mark.slow
def test_scripts_and_fuzzing_reach_the_branches_of_the_core(tmp_path: Path) -> None:
    _needs("make", "gcc", "gcovr", "clang")
    _make("fuzz", tmp_path, RUNS=20 * RUNS, SEED=1)
    said = _make("coverage", tmp_path, PYTHON=_python(), REQUESTS=REQUESTS, LEAST=LEAST_BRANCHES)
    (branches,) = re.findall(r"branches: ([\d.]+)%", said)
    assert float(branches) >= LEAST_BRANCHES


@pytest.mark.slow
def test_the_fuzzer_finds_nothing_in_the_core_with_the_loop_and_reaches_its_branches(tmp_path: Path) -> None:
    _needs("make", "gcc", "gcovr", "clang")
    tick = built_tick("host")
    said = _make("fuzz-loop", tmp_path, TICK=tick, PYTHON=_python(), RUNS=2 * RUNS, SEED=1)
    assert re.findall(r"Done (\d+) runs", said) == [str(RUNS)] * 2
    said = _make("coverage-loop", tmp_path, TICK=tick, PYTHON=_python(), LEAST_LOOP=LEAST_BRANCHES_OF_LOOP)
    (branches,) = re.findall(r"branches: ([\d.]+)%", said)
    assert float(branches) >= LEAST_BRANCHES_OF_LOOP


@pytest.mark.parametrize("with_loop", [False, True])
def test_cppcheck_says_nothing(with_loop: bool) -> None:
    _needs("make", "cppcheck")
    tick = [f"TICK={built_tick('host')}"] if with_loop else []
    command = ["make", "-s", "-C", str(FOLDER), "cppcheck", *tick]
    said = subprocess.run(command, capture_output=True, text=True, timeout=CHECKS_S, check=False)
    assert (said.returncode, said.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_both_compilers_say_nothing(compiler: str, tmp_path: Path) -> None:
    _needs("make", compiler)
    assert "warning" not in _make("script", tmp_path, CC=compiler)
