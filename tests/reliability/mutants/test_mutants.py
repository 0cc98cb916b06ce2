"""Mutants are what they say, the same for the same seed, and judged without touching what is there."""

import sys
from pathlib import Path

import pytest

from tests.reliability.mutants.__main__ import ROOT
from tests.reliability.mutants.choosing import (
    ELSEWHERE,
    EQUIVALENT,
    PACKAGES,
    Mutant,
    chosen,
    mirrored_tests,
    mutants_of,
    shares,
)
from tests.reliability.mutants.operators import changed, changes
from tests.reliability.mutants.running import Verdict, judged
from tests.reliability.mutants.telling import compared, read, survivors, table, write


@pytest.mark.parametrize(
    ("source", "others"),
    [
        ("a < b", ["a <= b", "a >= b"]),
        ("a == b", ["a != b"]),
        ("a is not b", ["a is b"]),
        ("a not in b", ["a in b"]),
        ("a < b == c", ["a < b != c", "a <= b == c", "a >= b == c"]),
        ("a + b", ["a - b"]),
        ("a // b ** c", ["a / b ** c", "a // b * c"]),
        ("((a)  # a - b\n - b)", ["((a) + b)"]),
        ("a and b or c", ["a or b or c", "a and b and c"]),
        ("not a", ["a"]),
        ("-a", ["a"]),
        ("f(0.5, True)", ["f(1.5, True)", "f(0.5, False)"]),
        ("2j", ["3j"]),
        ("x.min(axis=0)", ["x.max(axis=0)", "x.min(axis=1)"]),
        ("np.minimum(a, b)", ["np.maximum(a, b)"]),
        ("a -= 1", ["a += 1", "a -= 2"]),
        ("for a in b: break", ["for a in b: continue"]),
        ("def f(a: int = 3) -> int: ...", ["def f(a: int = 4) -> int: ..."]),
        ("class A:\n    b: int = 3", ["b: int = 4"]),
    ],
)
def test_an_expression_becomes_another_one(source, others):
    found = changes(source)
    whole = [one.after if one.after in others else changed(source, one) for one in found]
    assert sorted(whole) == sorted(others)
    for one in found:
        changed(source, one)


@pytest.mark.parametrize(
    "source",
    [
        '"""1 < 2, and not -3."""',
        "__all__ = ['a'][1:]",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    a = 1 + 2",
        "def f(a: Literal[1, 2]) -> tuple[int, 3]: ...",
        "@cache(3)\ndef f(): ...",
        "raise ValueError(3 + a)",
        "f'{a + 1:.3f}'",
        "isinstance(a, int | float)",
        "zip(a, b, strict=True)",
        "Number = int | float",
        "Number: TypeAlias = Literal[3]",
        "folder / 'name' / f'{a}'",
        "if __name__ == '__main__': ...",
    ],
)
def test_what_is_not_computed_with_is_left_alone(source):
    assert changes(source) == []


def test_a_mutant_is_shown_with_its_line_function_and_the_statement_around_it():
    source = (
        "def f(a):\n    class B:\n        c = [\n            a,\n            1 +  # one\n            2,\n        ]\n"
    )
    one, *_ = (one for one in changes(source) if one.operator == "arithmetic")
    assert (one.function, one.line, one.before, one.after) == ("f.B", 5, "c = [ a, 1 + 2, ]", "c = [ a, 1 - 2, ]")
    long = "f(" + "a, " * 30 + "1" + ", a" * 30 + ")"
    assert len(changes(long)[0].before) < 90


def test_every_mutant_of_a_module_is_python_and_says_something_else():
    found = mutants_of(ROOT, "controller/lock.py")
    source = (ROOT / "controller/lock.py").read_text(encoding="utf-8")
    assert len({changed(source, one.change) for one in found}) == len(found) == len({one.name for one in found})


def test_what_has_a_name_as_equivalent_is_a_mutant_of_today():
    paths = {name.split("::")[0] for name in EQUIVALENT}
    names = {mutant.name for path in paths if (ROOT / path).exists() for mutant in mutants_of(ROOT, path)}
    assert [name for name in EQUIVALENT if name not in names] == []


def test_every_package_has_its_share_and_some_at_least():
    assert shares({"a": 900, "b": 100}, 100) == {"a": 90, "b": 10}
    assert shares({"a": 997, "b": 2, "c": 1}, 100) == {"a": 97, "b": 2, "c": 1}
    assert shares({"a": 1000, "b": 1000, "c": 10}, 60) == {"a": 29, "b": 28, "c": 3}
    assert shares({"a": 3, "b": 2}, 100) == {"a": 3, "b": 2}
    assert sum(shares({"a": 7, "b": 7, "c": 7}, 10).values()) == 10


@pytest.fixture
def project(tmp_path):
    """A product of one package, with tests."""
    return made(
        tmp_path / "project",
        {
            "pyproject.toml": "[tool.pytest.ini_options]\nmarkers = ['slow', 'hardware']\n",
            "fake/__init__.py": "",
            "fake/sums.py": "def total(a, b):\n    return a + b\n\n\ndef least(a):\n    return min(a)\n",
            "fake/counts.py": "def count(n):\n    while n > 0:\n        n -= 1\n    return n\n",
            "fake/alone/__init__.py": "STEP = 1\n",
            "tests/fake/test_sums.py": "from fake.sums import *\n\n\ndef test_it():\n    assert total(1, 2) == 3\n",
            "tests/fake/test_counts.py": "from fake.counts import *\n\n\ndef test_it():\n    assert count(3) == 0\n",
        },
    )


def made(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def all_of(folder: Path) -> dict[str, tuple[bytes, int]]:
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): (path.read_bytes(), path.stat().st_mtime_ns) for path in found}


def fates(mutants: list[Mutant], *rest, **named) -> dict[str, str]:
    return {name.split(": ", 1)[1]: verdict.fate for name, verdict in judged(mutants, *rest, **named).items()}


posix = pytest.mark.skipif(sys.platform == "win32", reason="groups of processes are ended by signals of POSIX")


@pytest.mark.slow
@posix
def test_a_mutant_is_killed_by_the_test_that_fails_and_one_without_a_check_survives(project):
    before = all_of(project)
    found = fates(mutants_of(project, "fake/sums.py"), project, project, ["fake"])
    assert found == {"return a + b -> return a - b": "killed", "return min(a) -> return max(a)": "survived"}
    assert all_of(project) == before


@pytest.mark.slow
@posix
def test_tests_of_another_checkout_judge_the_same_mutants(project, tmp_path):
    other = made(
        tmp_path / "other",
        {
            "pyproject.toml": "[tool.pytest.ini_options]\nmarkers = ['slow', 'hardware']\n",
            "tests/fake/test_sums.py": "from fake.sums import *\n\n\ndef test_it():\n    assert least([1, 2]) == 1\n",
        },
    )
    found = fates(mutants_of(project, "fake/sums.py"), project, other, ["fake"])
    assert found == {"return a + b -> return a - b": "survived", "return min(a) -> return max(a)": "killed"}


@posix
@pytest.mark.slow
def test_a_mutant_that_never_ends_is_killed_by_time(project):
    endless = [one for one in mutants_of(project, "fake/counts.py") if "+= 1" in one.name]
    assert fates(endless, project, project, ["fake"], limit_s=10.0) == {"n -= 1 -> n += 1": "killed by time"}


@posix
def test_tests_that_take_too_long_anyway_judge_none(project):
    one = mutants_of(project, "fake/sums.py")[1:]
    assert fates(one, project, project, ["fake"], limit_s=0.05) == {"return min(a) -> return max(a)": "not judged"}


@pytest.mark.slow
@posix
def test_what_no_test_mirrors_and_what_fails_anyway_is_judged_by_none(project):
    (project / "tests" / "fake" / "test_counts.py").write_text("def test_it():\n    assert False\n")
    one = mutants_of(project, "fake/sums.py")[1:]
    assert fates(one, project, project, ["fake"]) == {"return min(a) -> return max(a)": "not judged"}
    for test in (project / "tests" / "fake").iterdir():
        test.unlink()
    assert fates(one, project, project, ["fake"]) == {"return min(a) -> return max(a)": "not covered"}


def test_a_seed_gives_the_same_mutants_and_a_short_run_is_part_of_a_long_one(project):
    def names(number, seed):
        return [one.name for one in chosen(project, ["fake"], number, seed)]

    assert names(4, 1) == names(4, 1)
    assert any(names(4, 1) != names(4, seed) for seed in range(2, 6))
    assert set(names(2, 1)) < set(names(4, 1))
    other = (project / "fake/counts.py").read_text().replace("\n    return n", "\n    n = n + 0\n    return n")
    before = set(names(100, 1))
    (project / "fake/counts.py").write_text(f"# a line above\n{other}")
    assert before < set(names(100, 1))


def test_tests_of_the_folder_judge_a_module_its_own_first():
    of_primitives = mirrored_tests("controller/primitives.py", ROOT / "tests")
    assert of_primitives[0] == "controller/test_primitives.py"
    of_harmonics = mirrored_tests("controller/harmonics/law.py", ROOT / "tests")
    assert of_harmonics[0] == "controller/test_harmonics.py"
    assert set(of_harmonics) == set(of_primitives)
    assert all(name.startswith("controller/test_") for name in of_primitives)
    for folder, others in ELSEWHERE.items():
        assert (ROOT / folder).is_dir()
        assert all((ROOT / "tests" / other).is_dir() for other in others)
    assert {path.name for path in (ROOT / "tests").iterdir()} >= set(PACKAGES)


def test_a_run_is_told_by_package_and_compared_with_another_one(project, tmp_path):
    mutants = mutants_of(project, "fake/sums.py")
    one, other = mutants
    first = {one.name: Verdict("killed", "a test", 1.0), other.name: Verdict("survived")}
    second = {one.name: Verdict("survived"), other.name: Verdict("killed by time")}
    assert table(mutants, first, [])[2:] == [
        "| fake | 2 | 1 | 0 | 1 | 0 | 0 | 50 % | 0 |",
        "| all | 2 | 1 | 0 | 1 | 0 | 0 | 50 % | 0 |",
    ]
    assert survivors(mutants, first) == ["fake/sums.py:6 least: return min(a) -> return max(a)"]
    for name, verdicts in (("first", first), ("second", second)):
        write(tmp_path / name, mutants, verdicts, {"seed": 1})
    assert read(tmp_path / "first") == first
    lines, lost = compared(tmp_path / "first", tmp_path / "second")
    assert lost == 1
    assert lines[0] == f"{one.name}: killed, now survived"
    assert compared(tmp_path / "first", tmp_path / "first")[1] == 0
