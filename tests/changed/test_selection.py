"""Which tests a change selects: in projects that are made up, and in this one."""

import subprocess
import sys

import pytest

from tests.changed.graph import PRODUCT, complete, drivers, import_graph, sources
from tests.changed.made import made_up
from tests.changed.plugin import ROOT, Ignoring
from tests.changed.selection import selected

ALWAYS = {"tests.docs.test_pages"}


def among(changed, **more):
    """What a change selects; in names of further modules a double underscore is a dot."""
    return selected(changed, *made_up({name.replace("__", "."): text for name, text in more.items()}))


def test_a_module_selects_the_tests_that_import_it_and_the_pages():
    more = {"tests__rig__test_a": "from rig.cli import main", "tests__rig__test_b": "from controller import Law"}
    assert among(["rig/text.py"], **more).kept == {"tests.rig.test_a"} | ALWAYS
    assert among(["controller/detector.py"], **more).kept == {"tests.rig.test_b"} | ALWAYS
    assert among(["controller/__init__.py"], **more).kept == {"tests.rig.test_b"} | ALWAYS
    assert among(["rig/text.py", "controller/law.py"], **more).kept == {"tests.rig.test_a", "tests.rig.test_b"} | ALWAYS


def test_a_test_file_selects_itself_and_a_fixture_what_is_below_it():
    more = {
        "tests__rig__test_a": "",
        "tests__rig__sub__conftest": "",
        "tests__rig__sub__test_b": "",
        "tests__rig__sub": "",
    }
    assert among(["tests/rig/test_a.py"], **more).kept == {"tests.rig.test_a"}
    assert among(["tests/rig/sub/conftest.py"], **more).kept == {"tests.rig.sub.test_b"}
    assert among(["tests/conftest.py"], **more).left == set()
    assert among(["tests/rig/sub/data.json"], **more).kept == {"tests.rig.sub.test_b"}


def test_data_in_a_package_select_what_depends_on_any_of_its_modules():
    more = {"rig__bench": "", "rig__bench__limits": "", "tests__rig__test_a": "import rig.bench.limits"}
    assert among(["rig/bench/shipped/beam.toml"], **more).kept == {"tests.rig.test_a"} | ALWAYS


def test_a_page_selects_the_tests_of_pages_and_those_that_name_it():
    more = {"tests__rig__test_a": "page = docs / 'formats.md'", "tests__rig__test_b": "for page in pages(): ..."}
    assert among(["docs/reference/formats.md"], **more).kept == {"tests.rig.test_a", "tests.rig.test_b"} | ALWAYS
    assert among(["README.md"], **more).kept == {"tests.rig.test_b"} | ALWAYS


def test_firmware_selects_its_tests_what_uses_them_and_the_pages():
    more = {"tests__firmware__building": "", "tests__rig__test_a": "import tests.firmware.building"}
    wanted = {"tests.firmware.test_arm", "tests.rig.test_a"} | ALWAYS
    assert among(["firmware/core/can.c"], **more, tests__rig__test_b="").kept == wanted


@pytest.mark.parametrize(
    "path", ["pyproject.toml", ".ci/requirements.lock", "LICENSE", "gone/module.py", "tests/data.json"]
)
def test_a_file_of_which_nothing_is_known_selects_all_and_says_so(path):
    found = among(["rig/text.py", path], tests__rig__test_a="")
    assert found.left == set()
    assert path in found.all_for


def test_a_module_that_is_gone_selects_what_still_names_it():
    more = {
        "tests__rig__test_a": "from rig.old import line",
        "tests__rig__test_b": "from rig import (\n    errors,\n    old,\n)",
        "tests__rig__test_c": "from rig.old_lines import line",
    }
    assert among(["rig/old.py"], **more).kept == {"tests.rig.test_a", "tests.rig.test_b"} | ALWAYS
    assert among(["tests/rig/test_gone.py"], **more).kept == set()


@pytest.fixture(scope="module")
def project():
    """Imports and sources of this project."""
    graph = import_graph(ROOT)
    text = sources(graph, ROOT)
    complete(graph, text, drivers(ROOT))
    return graph, text


def folders(modules):
    return {module.split(".")[1] for module in modules}


@pytest.mark.slow
def test_a_change_of_the_detector_leaves_modal_analysis_and_structures_out(project):
    kept = selected(["controller/detector.py"], *project).kept
    assert {"tests.controller.test_pll", "tests.rig.tick.test_tick", "tests.docs.test_pages"} <= kept
    assert not {
        module for module in kept if module.startswith(("tests.identification.linear", "tests.simulators.structures"))
    }


def test_a_change_of_the_page_of_a_run_selects_no_test_of_the_libraries(project):
    kept = selected(["rig/monitor/server.py", "rig/monitor/page/app.js"], *project).kept
    assert {"tests.rig.monitor.test_page_files", "tests.rig.monitor.browser.test_stop"} <= kept
    assert not {"simulators", "identification", "controller"} & folders(kept)


def test_a_change_of_how_kernels_are_compiled_selects_nearly_all(project):
    found = selected(["vibrolock/compiled.py"], *project)
    assert len(found.kept) > 3 * len(found.left)


def test_a_page_selects_no_test_of_the_libraries(project):
    kept = selected(["docs/explanation/damping.md"], *project).kept
    assert "tests.docs.test_pages" in kept
    assert "tests.rig.authoring.test_schemas" in kept  # reads the files of all pages
    assert folders(kept) <= {"docs", "rig", "changed"}
    assert len(kept) < 30


@pytest.mark.parametrize(
    "modules",
    [
        "tests.conftest, tests.controller.test_pll",
        "tests.conftest, tests.identification.decays.test_result",
        "tests.conftest, tests.rig.results.conftest, tests.rig.results.test_predict",
    ],
)
def test_all_that_a_test_file_imports_is_known(project, modules):
    code = f"import sys, {modules}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    imported = {name for name in done.stdout.split() if name.split(".")[0] in PRODUCT}
    assert imported
    found = project[0].find_upstream_modules(modules.split(", ")[-1])
    assert imported <= {name.removesuffix(".__init__") for name in found}


def test_files_and_folders_that_cannot_depend_on_a_change_are_not_collected():
    tuning = [path.relative_to(ROOT).as_posix() for path in (ROOT / "tests/controller/tuning").glob("test_*.py")]
    found = Ignoring(["tests/controller/test_pll.py", *tuning])
    for path, ignored in {
        "tests/controller/test_pll.py": True,
        "tests/controller/test_rest.py": None,
        "tests/controller/tuning/test_gains.py": True,
        "tests/controller/tuning": True,
        "tests/controller": None,
        "tests": None,
    }.items():
        assert found.pytest_ignore_collect(ROOT / path) is ignored, path
