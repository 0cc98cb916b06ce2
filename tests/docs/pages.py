"""Reading a page of documentation and doing what it says, block by block, in one folder.

Blocks that do something: ``bash`` (every command that begins with ``rig``), ``python``, and ``toml`` or ``python`` whose
first line is ``# file: NAME``, which are written to the folder. A ``text`` block right after commands is their output:
numbers are compared loosely, spacing not at all, ``…`` stands for any words, and on a line of its own for any lines.

A comment before a block changes what is done with it: ``<!-- not run: REASON -->``, ``<!-- exit status N -->``,
``<!-- interrupted after the first point -->``.
"""

import contextlib
import io
import math
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from rig.cli import main

ROOT = Path(__file__).parents[2]
SETUP = re.compile(r"(python3?|py|pip|pytest|git|export|cd)\b")
FILE = re.compile(r"# file: (\S+)")
NOTE = re.compile(r"<!--\s*(.*?)\s*-->")
INTERRUPTED = "interrupted after the first point"


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, text, first line on the page, and the comment right before it."""

    language: str
    text: str
    line: int
    note: str

    @property
    def not_run(self) -> str:
        """Why it is not run; empty where it is."""
        return self.note.removeprefix("not run:").strip() if self.note.startswith("not run:") else ""

    @property
    def file(self) -> str:
        """Name of the file that it is to be written to; empty where there is none."""
        found = FILE.match(self.text)
        return found.group(1) if found else ""

    @property
    def status(self) -> int:
        """Exit status that its last command must have."""
        return int(self.note.removeprefix("exit status ")) if self.note.startswith("exit status ") else 0


def pages() -> list[Path]:
    """Every page whose commands and examples must work."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks of a page, in order."""
    note, language, first, text = "", None, 0, list[str]()
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if language is not None:
            if line.strip() == "```":
                yield Block(language, "\n".join(text), first, note)
                note, language, text = "", None, []
            else:
                text.append(line)
        elif line.startswith("```"):
            language, first = line[3:].strip(), number
        elif line.strip():
            found = NOTE.fullmatch(line.strip())
            note = found.group(1) if found else ""


def rig_commands(block: Block) -> list[list[str]]:
    """Arguments of every ``rig`` in a block of commands; a command that is neither that nor a setup step fails the test."""
    out = []
    for line in block.text.replace("\\\n", " ").splitlines():
        for command in line.removeprefix("$ ").split("&&"):
            words = shlex.split(command, comments=True)
            if not words:
                continue
            name = Path(words[0]).name
            if name == "rig":
                out.append(words[1:])
            else:
                assert SETUP.match(name), f"line {block.line}: {command.strip()!r} is neither a rig command nor setup"
    return out


@dataclass
class Reader:
    """Somebody who follows a page; what was printed last is kept for the block that shows it."""

    page: Path
    names: dict[str, Any] = field(default_factory=dict)
    printed: str = ""

    def follow(self) -> None:
        """Do everything that the page says, in the present folder."""
        for block in blocks(self.page):
            where = f"{self.page.name}, line {block.line}"
            if block.not_run:
                continue
            if block.file:
                Path(block.file).write_text(block.text + "\n", encoding="utf-8")
            elif block.language in ("bash", "console"):
                self.printed = self._commands(block, where)
            elif block.language == "python":
                self.printed = self._python(block, where)
            elif block.language == "text" and self.printed:
                assert_shows(block.text, self.printed, where)

    def _commands(self, block: Block, where: str) -> str:
        printed = ""
        commands = rig_commands(block)
        for number, words in enumerate(commands):
            if block.note == INTERRUPTED:
                printed += interrupted(words)
                continue
            status, text = run_rig(words)
            expected = block.status if number == len(commands) - 1 else 0
            assert status == expected, f"{where}: rig {' '.join(words)} ended with {status}\n{text}"
            printed += text
        return printed

    def _python(self, block: Block, where: str) -> str:
        streams = io.StringIO()
        code = compile("\n" * block.line + block.text, str(self.page), "exec")
        with contextlib.redirect_stdout(streams):
            try:
                exec(code, self.names)
            except Exception as error:
                pytest.fail(f"{where}: {type(error).__name__}: {error}")
        return streams.getvalue()


def run_rig(words: list[str]) -> tuple[int, str]:
    """Exit status of a command, and what it printed: progress, then results."""
    out, err = io.StringIO(), io.StringIO()
    before, sys.argv = sys.argv, ["rig", *words]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stop:
            main()
    finally:
        sys.argv = before
    return int(stop.value.code or 0), err.getvalue() + out.getvalue()


def interrupted(words: list[str]) -> str:
    """Run a command in a process of its own and press Ctrl-C once it has reported a point; it must end with 1."""
    command = [sys.executable, "-c", "from rig.cli import main; main()", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stderr is not None
        first = child.stderr.readline()
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=60)
    assert first.startswith("point"), first + err
    assert child.returncode == 1, err
    return first + err + out


def assert_shows(shown: str, printed: str, where: str) -> None:
    """Every line shown is among those printed, in their order; between two of them none is missing but at a ``…``."""
    lines = [line.split() for line in printed.splitlines() if line.strip()]
    at, gap = 0, True
    for line in shown.splitlines():
        words = line.split()
        if words == ["…"]:
            gap = True
            continue
        if not words:
            continue
        reach = range(at, len(lines)) if gap else range(at, min(at + 1, len(lines)))
        found = next((n for n in reach if same(words, lines[n])), None)
        assert found is not None, f"{where}: {line!r} is not what was printed:\n{printed}"
        at, gap = found + 1, False


def same(shown: list[str], printed: list[str]) -> bool:
    """Whether two lines agree word by word: equal, or numbers that are close; ``…`` stands for any words."""
    if not shown or not printed:
        return not printed if not shown else shown == ["…"]
    if shown[0] == "…":
        return any(same(shown[1:], printed[n:]) for n in range(1, len(printed) + 1))
    return (shown[0] == printed[0] or close(shown[0], printed[0])) and same(shown[1:], printed[1:])


def close(a: str, b: str) -> bool:
    """Whether two words are numbers that agree within 2 % or 0.02; another machine may draw other last digits."""
    try:
        return math.isclose(float(a), float(b), rel_tol=0.02, abs_tol=0.02)
    except ValueError:
        return False
