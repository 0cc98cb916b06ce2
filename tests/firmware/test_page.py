"""The board on the page "Write a board" compiles and links with the core, for this computer and for a Cortex-M4."""

import subprocess

import pytest

from tests.docs.pages import ROOT, blocks
from tests.firmware.building import FOLDER, need

PAGE = ROOT / "docs" / "how-to" / "write-a-board.md"
CORE = FOLDER / "core"
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
ENTRY = "-Wl,-e,main"  # no startup code: it is the vendor's


def options():
    """The options of the command on the page, without its files and its processor."""
    (command,) = (block.text for block in blocks(PAGE) if block.language == "bash" and "-gcc" in block.text)
    words = command.replace("\\\n", " ").split()
    return [word for word in words if word.startswith(("-std", "-O", "-f", "-Wl", "-D"))]


@pytest.mark.parametrize(
    "compiler",
    [("cc",), ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "--specs=nosys.specs", ENTRY)],
    ids=["cc", "arm"],
)
def test_the_board_of_the_page_links_with_the_core(compiler, tmp_path):
    need(compiler[0], *(["newlib"] if compiler[0] != "cc" else []))
    (board,) = (block.text for block in blocks(PAGE) if block.language == "c")
    source = tmp_path / "board.c"
    source.write_text(board, encoding="utf-8")
    sources = [str(source), *map(str, sorted(CORE.glob("*.c")))]
    command = [*compiler, *options(), *STRICT, f"-I{CORE}", *sources, "-o", str(tmp_path / "board")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    symbols = subprocess.run(["nm", str(tmp_path / "board")], capture_output=True, text=True, check=True).stdout
    assert "vl_serve" in symbols
    assert "vl_can" not in symbols  # the wire that the board does not name
