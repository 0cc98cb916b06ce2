"""The firmware's parts know each other one way: no circle among the headers, and none among the files that use each other."""

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.firmware.building import FOLDER

GROUPS = [FOLDER / "core", *(path for path in sorted((FOLDER / "boards").iterdir()) if path.is_dir())]
DEFINED = re.compile(
    r"^(?!static|extern|typedef|return|#)[a-z_][\w* ]*?\b([a-z]\w+)(?:\[[^\n]*\])?(?:\([^;{]*\)\s*\{|(?: =[^\n]*)?;|,)",
    re.MULTILINE,
)
"""Functions and variables that a file gives to others; they stand at the beginning of a line."""
FURTHER = re.compile(r"^(?:struct|uint\w+|int\w+|bool) [^\n({]*, (\w+);", re.MULTILINE)
CALLBACKS = {"bench_output", "bench_sent_bytes", "bench_sent_frame"}
"""What `bench.h` asks of the program around the bench, as `board.h` asks a board."""
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def without_comments(path: Path) -> str:
    return COMMENT.sub("", path.read_text(encoding="utf-8"))


def defined(text: str) -> set[str]:
    """Names that a file gives to others."""
    return {*DEFINED.findall(text), *FURTHER.findall(text)}


def uses_of(folder: Path) -> dict[str, set[str]]:
    """The files of a folder whose names a file uses, by file."""
    texts = {path.name: without_comments(path) for path in sorted(folder.glob("*.c"))}
    home = {name: file for file, text in texts.items() for name in defined(text)}
    return {
        file: {home[word] for word in set(re.findall(r"\w+", text)) - defined(text) - CALLBACKS if word in home}
        for file, text in texts.items()
    }


def order_of(uses: dict[str, set[str]]) -> list[str]:
    """The files, each behind those that it uses; the test fails where there is no such order."""
    try:
        return list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        return pytest.fail(f"a circle: {' <- '.join(error.args[1])}")


def test_the_names_of_a_file_are_found():
    text = "int32_t vl_output(void)\n{\n    vl_call(1);\n}\nstruct vl_settings vl_settings, vl_in_force;\nstatic int own;\n"
    assert defined(text) == {"vl_output", "vl_settings", "vl_in_force"}
    assert "life.c" in uses_of(FOLDER / "core")["sampling.c"]


@pytest.mark.parametrize("folder", GROUPS, ids=lambda folder: folder.name)
def test_files_use_each_other_one_way(folder):
    order_of(uses_of(folder))


def test_headers_include_each_other_one_way():
    headers = {path.name: without_comments(path) for path in FOLDER.rglob("*.h")}
    order_of({name: set(re.findall(r'^#include "(\w+\.h)"', text, re.MULTILINE)) for name, text in headers.items()})
