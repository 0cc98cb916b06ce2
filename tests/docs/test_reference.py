"""Pages of the reference name every command and every public name, and no other."""

import re

import pytest
from typer.main import get_command

import rig.cli
from rig.reference.commands import commands_of
from rig.reference.names import MODULES, public_names
from tests.docs.pages import ROOT, blocks

REFERENCE = ROOT / "docs" / "reference"
COMMANDS = REFERENCE / "commands.md"


def shown(directive, pages):
    """Argument and lines of every block of a directive."""
    for page in sorted(pages):
        for block in blocks(page):
            if block.language.startswith(f"{{{directive}}} "):
                yield (
                    block.language.partition(" ")[2],
                    [line for line in block.text.split() if not line.startswith(":")],
                )


def test_the_page_of_commands_has_each_once():
    named = [f"rig {argument}" for argument, _ in shown("command-help", [COMMANDS])]
    assert sorted(named) == sorted(command.name for command in commands_of(get_command(rig.cli.app)))


def test_a_command_stands_under_its_own_heading():
    text = COMMANDS.read_text(encoding="utf-8")
    found = re.findall(r"^### (rig .*)\n\n```\{command-help\} (.*)$", text, re.MULTILINE)
    assert found
    assert len(found) == text.count("{command-help}")
    assert all(heading == f"rig {name}" for heading, name in found)


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_stands_on_one_page(module):
    pages = [*(REFERENCE / "api").glob("*.md"), REFERENCE / "errors.md"]
    named = [name for argument, names in shown("names", pages) if argument == module for name in names]
    assert sorted(named) == sorted(public_names(module))
