"""Pages of the reference name every command and every public name, and no other."""

import inspect
import re
from importlib import import_module

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


@pytest.mark.parametrize("module", MODULES)
def test_a_public_function_of_several_parameters_has_a_table_of_them(module):
    for name in public_names(module):
        function = getattr(import_module(module), name)
        if not inspect.isfunction(function) or function.__module__.endswith(".deprecated"):
            continue
        parameters = inspect.signature(function).parameters.values()
        named = {one.name for one in parameters if one.kind is not inspect.Parameter.VAR_KEYWORD}
        if len(parameters) > 1:
            table = (inspect.getdoc(function) or "").partition("Parameters\n----------\n")[2].partition("\n\n")[0]
            terms = {term for line in re.findall(r"^(\w.*)$", table, re.MULTILINE) for term in line.split(", ")}
            assert named <= terms, f"{module}.{name}: {named - terms}"
            assert terms == named or len(named) < len(parameters), f"{module}.{name}: {terms - named}"
