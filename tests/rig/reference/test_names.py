"""Public names: documented, each once, and packages that introduce theirs."""

import contextlib
import inspect
import io
import re
from importlib import import_module

import pytest

from rig.reference.names import MODULES, first_line, name_entries, public_names

PACKAGES = ("rig", "controller", "simulators", "identification")
LONGEST_HELP = 110


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_says_what_it_is(module):
    for name in public_names(module):
        assert first_line(module, name).endswith((".", ":")), f"{module}.{name}"


def test_a_name_is_listed_once():
    titles = [entry.title for entry in name_entries()]
    assert len(titles) == len(set(titles))
    assert "rig.Bench" in titles
    assert "rig.bench.Bench" not in titles


def docstring(package):
    return str(inspect.getdoc(import_module(package)))


@pytest.mark.parametrize("package", PACKAGES)
def test_help_begins_with_an_example_and_introduces_every_name_on_a_few_pages(package):
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        help(import_module(package))
    text = shown.getvalue()
    assert text.count("\n") < LONGEST_HELP
    assert "First::" in "\n".join(text.splitlines()[:8])
    for name in public_names(package):
        assert re.search(rf"\b{name}\b", docstring(package)), name


@pytest.mark.parametrize("package", PACKAGES)
def test_the_example_runs(package, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    found = re.search(r"First::\n\n((?:    .*\n|\n)+)", docstring(package))
    assert found
    code = inspect.cleandoc("\n" + found[1])
    assert len([line for line in code.splitlines() if line]) <= 5
    exec(code, {})
    assert list(tmp_path.iterdir()) == []
