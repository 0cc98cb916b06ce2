"""A page of documentation as blocks that say what to do.

Blocks that do something: ``bash`` (every command that begins with ``rig``), ``python``, and ``toml`` or ``python`` whose
first line is ``# file: NAME``, which are written to a folder. A ``text`` block right after commands is their output.

A comment before a block changes what is done with it: ``<!-- not run: REASON -->``, ``<!-- exit status N -->``,
``<!-- interrupted after the first point -->``.
"""

import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
SETUP = re.compile(r"(python3?|py|pip|pytest|git|make|export|cd)\b")
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
    made = ROOT / "docs" / "gallery"  # by Sphinx
    return [ROOT / "README.md", *(page for page in sorted((ROOT / "docs").rglob("*.md")) if made not in page.parents)]


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


def write(block: Block, folder: Path) -> None:
    """Write a block to its file; a ``pyproject.toml`` also gets the entry points that installing it would leave."""
    (folder / block.file).write_text(block.text + "\n", encoding="utf-8")
    if block.file != "pyproject.toml":
        return
    project = tomllib.loads(block.text)["project"]
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = [line for group, names in project["entry-points"].items() for line in entries(group, names)]
    (info / "entry_points.txt").write_text("\n".join([*lines, ""]))


def entries(group: str, names: dict[str, str]) -> list[str]:
    """A group of entry points in the form in which they are installed."""
    return [f"[{group}]", *(f"{name} = {target}" for name, target in names.items())]


def table_under(heading: str, text: str) -> re.Match[str]:
    """The first table below a heading."""
    found = re.search(
        rf"^#+ {re.escape(heading)}$(?:(?!^#).)*?(?P<table>(?:^\|[^\n]*\n)+)", text, re.MULTILINE | re.DOTALL
    )
    assert found, f"no table under {heading!r}"
    return found
