"""Somebody who does what a page says, block by block, in the present folder."""

import contextlib
import io
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.docs.output import assert_shows
from tests.docs.pages import INTERRUPTED, Block, blocks, rig_commands, write
from tests.docs.shared_commands import run_shared
from tests.waiting import LONG_S


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
                write(block, Path())
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
            status, out, err = run_shared(words)
            text = err + out  # progress, then results
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


def interrupted(words: list[str]) -> str:
    """Run a command in a process of its own and press Ctrl-C once it has reported a point; it must end with 1."""
    command = [sys.executable, "-c", "from rig.cli import main; main()", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stderr is not None
        first = next(line for line in child.stderr if not line.startswith("["))  # said while nothing else is
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=LONG_S)
    assert first.startswith("point"), first + err
    assert child.returncode == 1, err
    return first + err + out
