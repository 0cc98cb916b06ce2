"""Code that a recording names is imported for nobody who has not said so; code that a bench names is told."""

import sys
import zlib
from pathlib import Path

import pytest

import rig
from rig.bench import load_bench
from rig.bench.user_code import named_code
from rig.campaigns.running.continuation import remaining
from rig.errors import ConfigurationError
from rig.measurements import sweeps
from rig.recording.reader import Recording
from tests.refused import refused

MODULE = """
from pathlib import Path
import numba

Path("imported.txt").write_text("yes")

@numba.cfunc("float64(float64, CPointer(float64))")
def drag(velocity_m_s, parameters):
    return -parameters[0] * velocity_m_s * abs(velocity_m_s)
"""
BENCH = """
base = "magnet-beam"
name = "in-air"

[[driver.options.elements]]
kind = "user"
at = "tip"
of = "velocity"
function = "NAME:drag"
parameters = [0.05]
"""
PLAN = """
kind = "sweep"
bench = "bench.toml"
start_hz = 22.0
stop_hz = 23.0
rate_hz_per_s = 2.0
levels_v = [0.1]
"""
LINES = """
kind = "multisine"
bench = "bench.toml"
lowest_hz = 15.0
highest_hz = 35.0
resolution_hz = 0.5
transient_periods = 3
periods = 2
realisations = 2
levels_rms_v = [0.05]
"""
OTHER = PLAN.replace("[0.1]", "[0.1, 0.2]")


@pytest.fixture
def lab(tmp_path, monkeypatch, request):
    """A folder with a bench whose force law is in a module there that leaves a trace when it is imported."""
    name = f"law_{zlib.crc32(request.node.name.encode())}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    (tmp_path / "bench.toml").write_text(BENCH.replace("NAME", name))
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "other.toml").write_text(OTHER)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield name
    sys.modules.pop(name, None)


def forgotten(name):
    """As in another process, on another day."""
    sys.modules.pop(name, None)
    Path("imported.txt").unlink()


def test_a_function_that_a_bench_file_names_is_told_and_recorded(lab, command):
    status, _, err = command("run plan.toml -o run.h5")
    assert status == 0, err
    assert err.count(f"note: function {lab}:drag imported from ./{lab}.py\n") == 1
    with Recording("run.h5") as recording:
        code = recording.parts[0].information["about"]["code"]
    assert code == [{"function": f"{lab}:drag", "file": str(Path(f"{lab}.py").absolute())}]


def test_what_a_recording_names_is_imported_by_resume_with_trust_only(lab, command):
    assert command("run plan.toml -o run.h5")[0] == 0
    forgotten(lab)
    before = Path("run.h5").read_bytes()
    status, _, err = command("resume run.h5 --plan other.toml")
    assert status == 1
    assert err == (
        f"rig: run.h5: bench: function = '{lab}:drag': is code that the recording names, and is not imported unless you "
        "trust it: --trust-code\n"
    )
    with refused(ConfigurationError, "trust-code", field="bench"):
        rig.resume("run.h5", plan="other.toml")
    assert not Path("imported.txt").exists()
    assert lab not in sys.modules
    assert Path("run.h5").read_bytes() == before
    status, _, err = command("resume run.h5 --plan other.toml --trust-code")
    assert status == 0, err
    assert f"note: function {lab}:drag imported from ./{lab}.py" in err


def test_trust_in_code_can_be_given_from_python(lab):
    rig.run("plan.toml", output="run.h5").close()
    forgotten(lab)
    with rig.resume("run.h5", plan="other.toml", trust_code=True) as run:
        assert run.complete


def test_a_recording_is_shown_plotted_exported_and_completed_without_its_code(lab, command):
    assert command("run plan.toml -o run.h5")[0] == 0
    forgotten(lab)
    for line in (
        "show run.h5",
        "show run.h5 --json",
        "plot run.h5 -o run.png",
        "export run.h5 -o run.mat",
        "export run.h5 -o time.mat --data time",
        "resume run.h5",
    ):
        status, _, err = command(line)
        assert status == 0, (line, err)
    with Recording("run.h5") as recording:
        assert remaining(recording).to_measure == ()
        assert len(sweeps(recording)) == 1
    assert not Path("imported.txt").exists()
    assert lab not in sys.modules


def test_linear_modes_are_identified_without_the_code_of_the_recorded_bench(lab, command):
    Path("lines.toml").write_text(LINES)
    assert command("run lines.toml -o lines.h5")[0] == 0
    forgotten(lab)
    status, _, err = command("identify linear lines.h5 --count 1 -o modes.h5")
    assert status == 0, err
    assert not Path("imported.txt").exists()
    assert lab not in sys.modules


def test_checking_a_bench_of_the_user_at_several_levels_needs_no_trust(lab, command):
    status, _, err = command("check --bench bench.toml -o check.h5")
    assert "trust" not in err
    assert Path("imported.txt").exists()
    assert status in (0, 1)


def test_functions_are_found_wherever_in_the_options_they_stand():
    bench = load_bench("magnet-beam")
    options = {"a": [{"b": {"function": "x:y"}}], "function": ["p:q", {"function": "r:s"}]}
    told = bench.model_copy(update={"driver": bench.driver.model_copy(update={"options": options})})
    assert named_code(told) == ["p:q", "r:s", "x:y"]
    assert named_code(bench) == []
