"""Names of packages that are imported on first use: seen by completion, by `import *` and by type checkers."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from tests.refused import refused
from vibrolock.on_use import on_use

PACKAGES = ("rig", "controller", "simulators", "identification", "rig.drivers.virtual")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_is_listed_there_and_the_same_as_for_type_checkers(package):
    module = import_module(package)
    for statement in ast.walk(ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))):
        if isinstance(statement, ast.ImportFrom) and str(statement.module).startswith(package):
            for name in statement.names:
                assert name.name in module.__all__
                assert getattr(module, name.name) is getattr(import_module(str(statement.module)), name.name)
    for name in module.__all__:
        assert name in dir(module)
        assert getattr(module, name) is not None


def test_completion_shows_names_that_were_never_used():
    code = "import rig; print({'run', 'resume', 'Recording'} <= set(dir(rig)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "True\n"


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_name_is_an_attribute_error(package):
    with refused(AttributeError, "no-attribute-nonsense"):
        _ = import_module(package).nonsense


def test_a_type_checker_refuses_an_unknown_name_and_knows_the_others(tmp_path):
    api = pytest.importorskip("mypy.api")
    (tmp_path / "user.py").write_text("import controller\nreveal_type(controller.preset)\ncontroller.nonsense\n")
    only_ours = ["--no-site-packages", "--ignore-missing-imports"]  # of libraries the names need nothing
    out, _, _ = api.run(["--follow-imports=silent", *only_ours, "--config-file=", str(tmp_path / "user.py")])
    assert "def (specimen: " in out
    assert 'Module has no attribute "nonsense"' in out


def test_a_name_is_looked_up_once():
    figures = import_module("rig.figures")
    vars(figures).pop("View", None)
    get, names, exported = on_use("rig.figures")
    assert "View" in names()
    assert "View" in exported
    found = get("View")
    assert vars(figures)["View"] is found
