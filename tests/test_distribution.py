"""What is installed: the names, what wheel and sdist contain, and that a wheel works in an environment of its own."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("rig", "controller", "simulators", "identification", "vibrolock")


@pytest.mark.parametrize("name", PACKAGES)
def test_the_package_is_this_distribution_and_no_other(name):
    file = import_module(name).__file__
    assert file is not None
    assert Path(file).parent.parent == ROOT
    assert set(packages_distributions().get(name, ["vibrolock"])) == {"vibrolock"}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and sdist, built without a network: the sdist from the source, the wheel from the sdist."""
    if importlib.util.find_spec("hatchling") is None:
        pytest.skip("the build backend hatchling is not installed (pip install 'vibrolock[dev]')")
    folder = tmp_path_factory.mktemp("built")
    _run([sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(folder)], ROOT)
    (sdist,) = folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    source = folder / sdist.name.removesuffix(".tar.gz")
    _run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)], source)
    (wheel,) = folder.glob("*.whl")
    return wheel, sdist


def _run(command, folder, **further):
    out = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, **further)
    assert out.returncode == 0, out.stdout + out.stderr
    return out.stdout


def tracked(*folders):
    """Files that the project has below folders, without what Python and Sphinx leave there."""
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and not {"__pycache__", ".doctrees"} & set(path.parts):
                yield path.relative_to(ROOT).as_posix()


@pytest.mark.slow
def test_a_wheel_holds_all_modules_benches_plans_specimens_the_page_templates_and_type_markers(built):
    names = set(zipfile.ZipFile(built[0]).namelist())
    wanted = {name for name in tracked(*PACKAGES) if not name.endswith((".nbi", ".nbc"))}
    assert {"rig/monitor/page/index.html", "rig/drawing/interactive/uplot/uPlot.iife.min.js"} <= wanted
    assert {"rig/bench/shipped/magnet-beam.toml", "rig/campaigns/shipped/magnet-beam/backbone.toml"} <= wanted
    assert {"simulators/specimens/magnet-beam.toml", "rig/authoring/starts/bench.toml"} <= wanted
    assert {f"{package}/py.typed" for package in PACKAGES} <= wanted
    assert wanted - names == set()
    template = {name.replace("docs/", "rig/authoring/") for name in tracked("docs/driver-template")}
    assert template
    assert template - names == set()
    assert not [name for name in names if name.startswith(("tests/", "benchmarks/", "docs/", "studies/"))]


def test_an_sdist_also_holds_tests_documentation_and_what_a_contributor_reads(built):
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    files = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "SECURITY.md"}
    assert files <= names
    assert {"tests/conftest.py", "docs/tutorials/first-backbone.md", "benchmarks/__main__.py"} <= names


@pytest.fixture(scope="module")
def empty(built, tmp_path_factory):
    """An environment that holds this wheel alone; the libraries that it needs are found behind it."""
    folder = tmp_path_factory.mktemp("empty")
    venv.create(folder, with_pip=False)
    scripts = folder / ("Scripts" if os.name == "nt" else "bin")
    _install(built[0], scripts / "python")
    paths = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})
    libraries = dict.fromkeys(Path(str(one.__file__)).parents[1] for one in map(import_module, ("numpy", "typer")))
    (Path(paths["purelib"]) / "libraries.pth").write_text("\n".join(map(str, libraries)))
    return scripts


def _alone():
    """The environment of a process that finds nothing by itself but what is installed for it."""
    return {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}


def _install(wheel, python):
    install = ["install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-index", str(wheel)]
    _run([sys.executable, "-m", "pip", "--python", str(python), *install], wheel.parent, env=_alone())


def _in(empty, folder, name, *arguments):
    return _run([str(empty / name), *arguments], folder, env=_alone())


@pytest.mark.slow
def test_commands_and_their_help_work_from_the_wheel(empty, tmp_path):
    assert "Phase-locked nonlinear vibration tests" in _in(empty, tmp_path, "rig", "--help")
    where = _in(empty, tmp_path, "python", "-c", "import rig; print(rig.__file__)")
    assert Path(where.strip()).is_relative_to(empty.parent)
    helps = """
import typer
from rig.cli import app
group = typer.main.get_command(app)
for name in group.commands:
    assert not app([name, "--help"], prog_name="rig", standalone_mode=False)
print(len(group.commands))
"""
    assert int(_in(empty, tmp_path, "python", "-c", helps).split()[-1]) > 20


@pytest.mark.slow
def test_new_files_and_shipped_ones_come_from_the_wheel(empty, tmp_path):
    assert "magnet-beam/backbone" in _in(empty, tmp_path, "rig", "list")
    _in(empty, tmp_path, "rig", "new", "driver", "-o", "box")
    assert (tmp_path / "box" / "vibrolock_box" / "driver.py").exists()
    _in(empty, tmp_path, "rig", "new", "rig", "-o", "mine.toml")
    schema = json.loads((tmp_path / "bench.schema.json").read_text(encoding="utf-8"))
    assert schema["properties"]["name"]["description"] == "Name, used in messages and files."


@pytest.mark.slow
def test_studies_are_a_wheel_of_their_own_that_brings_their_commands(empty, tmp_path):
    assert "pip install ./studies" in _in(empty, tmp_path, "rig", "reproduce", "--help")
    _run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)], ROOT / "studies")
    (wheel,) = tmp_path.glob("*.whl")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == set(tracked("studies")) - {"studies/pyproject.toml", "studies/README.md"}
    _install(wheel, empty / "python")
    assert "--realisations" in _in(empty, tmp_path, "rig", "reproduce", "--help")


def test_the_version_and_the_licence_are_those_of_the_citation():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {project['version']}\n" in citation
    studies = tomllib.loads((ROOT / "studies" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert studies["version"] == project["version"]
    assert studies["dependencies"] == [f"vibrolock=={project['version']}"]
    assert f"\nlicense: {project['license']}\n" in citation
    assert f"\n  - name: {project['authors'][0]['name']}\n" in citation
    assert f"\n## [{project['version']}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_uvx_runs_the_command_from_a_clone(tmp_path):
    """Into an environment of its own, from a registry; only where uv is installed, which no extra brings."""
    beside = Path(sys.executable).with_name("uvx")
    found = str(beside) if beside.exists() else shutil.which("uvx")
    if found is None:
        pytest.skip("uvx is not installed (pip install uv)")
    ready = [found, "--quiet", "--from", str(ROOT), "--python", sys.executable]
    out = subprocess.run([*ready, "rig", "--help"], cwd=tmp_path, capture_output=True, text=True, check=False)
    if out.returncode and any(word in out.stderr for word in ("Failed to fetch", "error sending request", "dns error")):
        pytest.skip("no package registry can be reached")
    assert out.returncode == 0, out.stderr
    assert "Usage: rig" in out.stdout
