"""The template for driver authors, installed as an outside package, is found by its entry point and passes the kit."""

import importlib.metadata
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tomllib

import pytest

from tests.docs.pages import ROOT
from tests.hardware.projects import FORKED_PYTEST

TEMPLATE = ROOT / "docs" / "driver-template"
PLUGIN = [] if importlib.util.find_spec("rig.pytest_plugin") is None else ["-p", "rig.pytest_plugin"]
if any(e.value == "rig.pytest_plugin" for e in importlib.metadata.entry_points(group="pytest11")):
    PLUGIN = []  # installed with its entry point, it is loaded anyway


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder that holds the installed template, and the source beside it."""
    folder = tmp_path_factory.mktemp("site")
    source = folder / "source"
    shutil.copytree(TEMPLATE, source)
    target = folder / "packages"
    work = folder / "work"  # where the package is not, so that only what is installed is found
    work.mkdir()
    shutil.copy(source / "box-bench.toml", work)
    shutil.copytree(source / "tests", work / "tests")
    if importlib.util.find_spec("hatchling"):
        quiet = ["--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--no-build-isolation"]
        subprocess.run([sys.executable, "-m", "pip", "install", *quiet, "--target", target, source], check=True)
    else:
        _installed_by_hand(source, target)
    return folder


def _installed_by_hand(source, target):
    """What an installer leaves, where its build backend is not at hand."""
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    shutil.copytree(source / "vibrolock_box", target / "vibrolock_box")
    info = target / f"vibrolock_box-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in entries.items()) for group, entries in groups]
    (info / "entry_points.txt").write_text("\n".join(lines))


def _run(site, *arguments):
    path = os.pathsep.join([str(site / "packages"), str(ROOT)])
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=site / "work",
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_template_passes_rig_conformance(site):
    done = _run(site, "-c", "from rig.cli import main; main()", "conformance", "--bench", "box-bench.toml", "--json")
    report = json.loads(done.stdout)
    assert [test for test in report["tests"] if test["outcome"] == "failed"] == []
    assert done.returncode == 0, done.stderr
    assert report["driver"] == "box"
    assert [test["outcome"] for test in report["tests"]].count("passed") >= 18


@pytest.mark.slow
def test_the_templates_own_tests_pass_with_every_duty_tested_that_it_takes_upon_itself(site):
    done = _run(site, *FORKED_PYTEST, "-q", "-rs", "tests")
    assert done.returncode == 0, done.stdout
    assert "safe without the host" in done.stdout
    assert "override witness" not in done.stdout
    assert "override unplug" not in done.stdout
    assert "override bench_for_another_process" not in done.stdout


@pytest.mark.slow
def test_the_template_passes_the_kit_under_pytest_and_the_result_names_it(site):
    arguments = ["--pyargs", "rig.conformance", "--rig-bench", "box-bench.toml", "--rig-result", "result.json"]
    done = _run(site, *FORKED_PYTEST, "-q", *PLUGIN, "-c", os.devnull, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((site / "work" / "result.json").read_text())
    assert (result["bench"], result["driver"], result["exit_status"]) == ("box-bench", "box", 0)
    assert result["versions"]["vibrolock"]
    assert {test["outcome"] for test in result["tests"]} == {"passed", "skipped"}


@pytest.mark.slow
def test_a_physical_bench_is_not_touched_without_arming(site):
    driver = site / "packages" / "vibrolock_box" / "driver.py"
    text = driver.read_text()
    driver.write_text(text.replace("virtual=True", "virtual=False"))
    try:
        command = _run(site, "-c", "from rig.cli import main; main()", "conformance", "--bench", "box-bench.toml")
        tests = _run(
            site,
            *FORKED_PYTEST,
            "-q",
            *PLUGIN,
            "-c",
            os.devnull,
            "--pyargs",
            "rig.conformance",
            "--rig-bench",
            "box-bench.toml",
        )
    finally:
        driver.write_text(text)
    assert command.returncode == 1
    assert "look, then give --arm" in command.stderr
    assert tests.returncode == 1
    assert "passed" not in tests.stdout
    assert "look, then give --rig-arm" in tests.stdout
