"""What modules import without an import statement of their own, in projects that are made up."""

import pytest

from tests.changed.graph import used_names
from tests.changed.made import made_up

TEST = "tests.rig.test_a"


def reached(own: str, **more: str) -> set[str]:
    """Modules that a test depends on; in names of further ones a double underscore is a dot."""
    graph, _ = made_up({TEST: own} | {name.replace("__", "."): text for name, text in more.items()})
    return graph.find_upstream_modules(TEST)


@pytest.mark.parametrize(
    "own",
    [
        "from controller import Detector",
        "import controller\ncontroller.Detector()",
        "import controller as law\nlaw.Detector()",
        "def test(): import controller.settings; controller.Detector()",
    ],
)
def test_a_name_that_is_imported_on_use_leads_to_its_module_alone(own):
    found = reached(own, controller__settings="")
    assert {"controller.detector", "vibrolock.on_use"} <= found
    assert "controller.law" not in found


@pytest.mark.parametrize("own", ["import controller\nhelp(controller)", "from controller import *"])
def test_a_package_that_is_used_as_a_whole_leads_to_all_its_modules(own):
    assert {"controller.detector", "controller.law"} <= reached(own)


def test_whoever_imports_a_module_runs_the_packages_around_it_and_nothing_that_these_import_on_use():
    found = reached("from controller.detector import Detector")
    assert "vibrolock.on_use" in found
    assert "controller.law" not in found
    assert "rig.text" in reached("import rig.cli.show", rig__cli__show="")


def test_a_test_depends_on_the_fixtures_around_it_and_on_nothing_beside_it():
    more = {"tests__rig__conftest": "import rig.figures", "tests__docs__conftest": "import rig.text"}
    found = reached("", **more)
    assert {"tests.conftest", "tests.rig.conftest", "rig.figures"} <= found
    assert "rig.text" not in found


@pytest.mark.parametrize(
    ("own", "module"),
    [
        ("run('from rig.cli import main; main()')", "rig.cli"),
        ("run([sys.executable, '-m', 'tests.rig.child'])", "tests.rig.child"),
        ("monkeypatch.setattr('rig.text.line', None)", "rig.text"),
        ("CODE = '''\nimport controller\ncontroller.Law()\n'''", "controller.law"),
        ("result.plot()", "rig.figures"),
        ("patch(f'rig.cli.{command}.line')", "rig.cli.show"),
        ("from rig.drivers import make_daq", "rig.drivers.virtual"),
    ],
)
def test_modules_that_stand_in_strings_or_are_found_by_name_count_as_imported(own, module):
    more = {"tests__rig__child": "", "rig__cli__show": ""}
    assert module in reached(own, **more)
    assert module not in reached("", **more)


@pytest.mark.parametrize(
    ("own", "module"),
    [
        ("DRAW = 'rig.figures.curves:draw'", "rig.figures.curves"),
        ("run([sys.executable, '-m', 'rig.figures'])", "rig.figures"),
        ("resolve_name(f'rig.figures.{name}')", "rig.figures.curves"),
        ("resolve_name(f'rig.figures.{folder_and_name}')", "rig.figures.kind.points"),
    ],
)
def test_addresses_in_the_product_count_as_imported_and_its_prose_does_not(own, module):
    more = {"rig__figures__curves": "", "rig__figures__kind": "", "rig__figures__kind__points": ""}
    assert module in reached("import rig.text", rig__text=own, **more)
    assert module not in reached("import rig.text", rig__text='"""See `rig.figures.curves`."""', **more)


@pytest.mark.parametrize(
    ("own", "used"),
    [
        ("import rig\nrig.run().plan\nrig.errors.Error", {"run", "errors"}),
        ("from rig import run as go, Bench", {"run", "Bench"}),
        ("def f(rig): return rig.run", set()),
        ("import rig\nfor module in (rig, other): ...", None),
        ("import rig.errors as errors\nerrors.Error", set()),
    ],
)
def test_names_that_a_module_takes_from_a_package(own, used):
    assert used_names(own, "rig") == used
