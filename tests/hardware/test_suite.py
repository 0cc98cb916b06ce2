"""The hardware-in-the-loop suite, as its users call it, on a virtual and on emulated benches; and its own promises."""

import json
import os
import subprocess
import sys

import pytest

from tests.docs.pages import ROOT
from tests.hardware.projects import FORKED_PYTEST, PLUGIN


def _pytest(folder, *arguments):
    result = folder / "result.json"
    command = [sys.executable, *FORKED_PYTEST, "-q", *PLUGIN, "-c", os.devnull, "--rig-result", result, *arguments]
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    return done, json.loads(result.read_text()) if result.exists() else {}


@pytest.mark.parametrize("wire", ["", "serial", pytest.param("can", marks=pytest.mark.slow)])
def test_the_suite_passes(tmp_path, wire):
    done, result = _pytest(tmp_path, "--pyargs", "rig.hil", *(["--rig-emulate", wire] if wire else []))
    assert done.returncode == 0, done.stdout[-3000:]
    assert result["bench"] == "magnet-beam"
    assert result["driver"] == (wire or "virtual")
    outcomes = {test["test"].rsplit("::")[-1]: test for test in result["tests"]}
    assert len(outcomes) == 9
    assert {test["outcome"] for test in outcomes.values()} == {"passed"}
    errors = outcomes["test_a_virtual_rig_is_measured_as_it_is"]["measured"]["frequency_error"]
    assert max(map(abs, errors)) < 1e-3
    assert all(result["versions"][name][0].isdigit() for name in ("vibrolock", "numpy", "numba", "pytest"))
    assert not wire or result["device"]["firmware"]


@pytest.mark.slow
def test_a_bench_that_is_missing_or_out_of_reach_is_an_error_and_no_skip(tmp_path):
    gone = tmp_path / "gone.toml"
    gone.write_text('base = "magnet-beam"\n[driver]\nname = "serial"\noptions.port = "/dev/no-such-port"\n')
    for bench, said in ((gone, "/dev/no-such-port"), ("none.toml", "none.toml")):
        done, result = _pytest(tmp_path, "--pyargs", "rig.hil", "--rig-bench", bench)
        assert done.returncode == 1
        assert said in done.stdout
        assert {test["outcome"] for test in result["tests"]} == {"error"}


OWN = """
import pytest

@pytest.mark.rig_needs(channels=["acc_nowhere"])
def test_a(armed_rig):
    raise AssertionError

@pytest.mark.rig_needs(physical=True)
def test_b():
    raise AssertionError

@pytest.mark.rig_needs(channels=4, virtual=True)
def test_c(rig_bench):
    assert rig_bench.name == "magnet-beam"

def test_d(rig_daq):
    rig_daq.start(1)
    test_d.daq = rig_daq
    raise KeyError("half-way")

def test_e():
    assert test_d.daq.state.value == "closed"
"""


@pytest.mark.slow
def test_what_a_bench_has_not_is_skipped_with_the_reason_and_a_failed_test_leaves_it_closed(tmp_path):
    (tmp_path / "test_own.py").write_text(OWN)
    done, result = _pytest(tmp_path, "test_own.py")
    found = {test["test"][-6:]: (test["outcome"], test["reason"]) for test in result["tests"]}
    assert [found[name][0] for name in sorted(found)] == ["skipped", "skipped", "passed", "failed", "passed"], (
        done.stdout
    )
    assert "needs channel 'acc_nowhere'" in found["test_a"][1]
    assert "needs something physical" in found["test_b"][1]


def test_the_plug_in_costs_nothing_at_import():
    heavy = "import sys, rig.pytest_plugin; sys.exit(any(m in sys.modules for m in ('numpy', 'numba', 'pydantic', 'scipy')))"
    assert subprocess.run([sys.executable, "-c", heavy], cwd=ROOT, check=False).returncode == 0
