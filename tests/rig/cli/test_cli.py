"""The command as its users type it: what it prints, its exit status, and one line for every mistake."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
import scipy.io

from simulators import VirtualRig
from simulators.parts import BeamStructure, Converter, IwanSite, Sensor
from tests.recorded import recorded_at

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8]
record_periods = 20

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):

    folder = tmp_path_factory.mktemp("recording")
    (folder / "plan.toml").write_text(PLAN)
    return recorded_at(folder / "run.h5", folder / "plan.toml")


def test_a_plan_runs_from_a_file_and_prints_a_line_for_each_point(command, tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    status, out, err = command("run plan.toml -o run.h5 --seed 3")
    assert status == 0
    assert "2 of 2 points accepted" in out
    assert err.count("point ") == 2
    assert (tmp_path / "run.h5").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.toml", "run.h5"]


def test_show_answers_in_json_with_everything_the_design_promises(command, recording):
    status, out, _ = command(f"show {recording} --json")
    assert status == 0
    summary = json.loads(out)
    assert summary["kind"] == "backbone"
    assert summary["specimen"]
    for key in ("force_n", "frequency_hz", "damping_ratio", "amplitude_m", "phase_error_deg", "settled", "periods"):
        assert all(key in point for point in summary["points"])
    for key in ("samples", "sample_rate_hz", "overruns", "periods", "wall_s", "realtime_factor", "end_to_end_factor"):
        assert summary["loop"][key] is not None


def test_show_prints_a_table(command, recording):
    status, out, _ = command(f"show {recording}")
    assert status == 0
    assert "frequency Hz" in out
    assert len(re.findall(r" (good|warned)$", out, re.MULTILINE)) == 2


@pytest.mark.slow
def test_a_recording_becomes_a_model_and_a_figure(command, recording, tmp_path):
    status, out, _ = command(f"identify {recording} -o model.h5 --json")
    assert status == 0
    points = json.loads(out)["points"]
    assert len(points) == 2
    assert {"modal_frequency_hz", "damping_ratio", "modal_amplitude", "mac", "force_n"} <= set(points[0])
    for source in (recording, tmp_path / "model.h5"):
        for ending in ("png", "pdf", "svg"):
            assert command(f"plot {source} -o figure.{ending}")[0] == 0
            assert (tmp_path / f"figure.{ending}").stat().st_size > 5000
    status, out, _ = command("show model.h5")
    assert status == 0
    assert "modal frequency Hz" in out


def test_measured_responses_are_imported_identified_shown_and_plotted(command, tmp_path):
    frequency = np.linspace(79.0, 81.0, 41)
    levels = []
    for amplitude, natural, zeta in ((5.0, 80.3, 0.0015), (10.0, 80.1, 0.002)):
        w, w0 = 2 * np.pi * frequency, 2 * np.pi * natural
        force = 0.5 * (w0**2 - w**2 + 2j * zeta * w0 * w) * (amplitude / w**2)
        levels.append({"f": frequency, "force": abs(force), "amp": np.full(41, amplitude), "phase": -np.angle(force)})
    scipy.io.savemat(tmp_path / "data.mat", {"levels": np.array(levels, dtype=object)})
    (tmp_path / "map.toml").write_text(MAPPING)
    status, out, err = command("import data.mat --format mat --mapping map.toml -o responses.h5")
    assert status == 0, err
    assert "2 levels" in out
    status, out, err = command("identify responses.h5 -o model.h5 --json")
    assert status == 0, err
    points = json.loads(out)["points"]
    assert [p["modal_frequency_hz"] for p in points] == pytest.approx([80.3, 80.1], rel=1e-6)
    assert [p["damping_ratio"] for p in points] == pytest.approx([0.0015, 0.002], rel=1e-4)
    assert command("plot responses.h5 -o responses.png")[0] == 0
    assert command("plot model.h5 -o model.png")[0] == 0


MAPPING = """
specimen = "beam"
source = "generated"

[units]
frequency = "Hz"
force = "N"
response = "m/s2"
values = "peak"

[phase]
unit = "rad"
of = "displacement"
sense = "response-minus-force"

[[sets]]
levels = "levels"
frequency = "f"
force = "force"
response = "amp"
phase = "phase"
controlled = "response"
level_values = [5, 10]
label = "{value:g} {unit}"
"""


def test_list_names_what_is_shipped(command):
    status, out, _ = command("list --json")
    assert status == 0
    shipped = json.loads(out)
    assert {"magnet-beam", "magnet-beam-symmetric"} <= {bench["name"] for bench in shipped["benches"]}
    assert "magnet-beam/backbone" in {plan["name"] for plan in shipped["plans"]}
    assert "virtual" in shipped["drivers"]
    assert "magnet-beam/backbone" in command("list")[1]


def test_list_names_the_specimens_and_every_part_of_a_virtual_rig(command):
    shipped = json.loads(command("list --json")[1])
    assert "friction-beam" in {specimen["name"] for specimen in shipped["specimens"]}
    groups = {part["group"] for part in shipped["parts"]}
    assert groups == set(VirtualRig.model_fields) - {"specimen", "provenance", "noise_scale", "seed"}
    names = {part["name"] for part in shipped["parts"]}
    assert {"beam", "magnet-one-sided", "cubic", "clearance", "user", "jenkins", "iwan", "sensor"} <= names
    assert all(part["description"] for part in shipped["parts"])
    out = command("list")[1]
    assert all(f" {name} " in out for name in names)


@pytest.mark.parametrize(
    ("name", "model", "either"),
    [
        ("iwan", IwanSite, set()),
        ("beam", BeamStructure, set()),
        ("sensor", Sensor, {"sensitivity", "sensitivity_v_per_unit"}),
        ("converter", Converter, set()),
    ],
)
def test_list_prints_the_keys_of_a_part_as_its_model_has_them(command, name, model, either):
    status, out, _ = command(f"list {name} --json")
    assert status == 0
    keys = {key["key"]: key for key in json.loads(out)["keys"]}
    described = model.model_json_schema()["properties"]
    assert {key for key in keys if "." not in key} == set(model.model_fields) | either
    assert not any(keys[key]["required"] for key in either)
    for key, field in model.model_fields.items():
        assert keys[key]["required"] == (field.is_required() and key not in either)
        assert keys[key]["description"] == described[key]["description"].replace("`", "").replace("\n", " ")
        if not field.is_required():
            assert keys[key]["default"] == json.loads(json.dumps(field.default))
    text = command(f"list {name}")[1]
    assert all(f"{key}: " in text for key in keys)


def test_list_states_types_ranges_and_units(command):
    out = command("list beam")[1]
    assert "length_m: number above 0, m, required" in out
    assert "youngs_modulus_pa: number above 0, Pa, required" in out
    assert "n_element: whole number from 4 to 400, default 40" in out
    assert "lumped_masses[].mass_kg: number from 0, kg, required" in out
    assert "supports[].rotational_stiffness_n_m_rad: number from 0, N m/rad" in out
    assert "phi_max_m: number above 0, m, required" in command("list iwan")[1]
    status, out, err = command("list nosuch")
    assert (status, out) == (1, "")
    assert "magnet-symmetric" in err
    assert len(err.strip().splitlines()) == 1


def test_doctor_says_what_the_machine_can_promise_and_which_ports_there_are(command, monkeypatch):
    monkeypatch.setattr("rig.wire.serial.port.port_names", lambda: ["/dev/ttyACM0"])
    status, out, _ = command("doctor --json")
    assert status == 0
    facts = json.loads(out)
    assert {"processors", "realtime_scheduling", "wake_up_lateness_us", "free_disk_gb", "drivers"} <= set(facts)
    assert facts["serial_ports"] == ["/dev/ttyACM0"]


def test_doctor_looks_at_the_device_of_a_bench(command):
    status, out, _ = command("doctor --daq friction-beam --json")
    facts = json.loads(out)
    assert status == 0
    assert facts["driver"] == "virtual"
    assert facts["reached_hz"] > facts["sample_rate_hz"]
    assert 0.0 < facts["block_us"]["p50"] <= facts["block_us"]["largest"]


@pytest.mark.parametrize(
    ("line", "status", "named"),
    [
        ("run nosuch -o x.h5", 1, "allowed: one of those that `rig list` shows, such as "),
        ("run magnet-beam/bakbone -o x.h5", 1, "magnet-beam/backbone"),
        ("run magnet-beam/backbone", 2, "--output"),
        ("run magnet-beam/backbone -o nowhere/x.h5", 1, "no such folder"),
        ("run magnet-beam/backbone -o x.h5 --bench nosuch", 1, "magnet-beam-symmetric"),
        ("run magnet-beam/backbone -o x.h5 --daq nosuch", 1, "virtual"),
        ("run magnet-beam/backbone -o x.h5 --seed -1", 2, "--seed"),
        ("run missing.toml -o x.h5", 1, "no such file"),
        ("resume x.h5", 1, "x.h5"),
        ("show x.h5", 1, "x.h5"),
        ("show .", 1, "."),
        ("plot x.h5 -o x.gif", 1, ".png"),
        ("identify x.h5 -o m.h5 --model tanh", 1, "nonlinear-mode"),
        ("import x.mat --mapping m.toml -o y.h5", 1, "m.toml"),
        ("frobnicate", 2, "frobnicate"),
    ],
)
def test_a_mistake_is_answered_in_one_line_and_leaves_no_file(command, tmp_path, line, status, named):
    code, out, err = command(line)
    assert code == status
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("rig: ")
    assert named in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (("levels_v", "levels_mN"), "levels_mN: unknown key, did you mean levels_m or levels_n?"),
        (("levels_v", "levels_w"), "levels_w: unknown key, did you mean levels_m or levels_n or levels_v?"),
        (("[0.4, 0.8]", "[0.4, -0.8]"), "levels_v[1] = -0.8 V; allowed: above 0"),
        (("[0.4, 0.8]", "[]"), "levels_v = []"),
        (("[0.4, 0.8]", "[0.4, 0.4]"), "given twice"),
        (("[0.4, 0.8]", "[0.4, nan]"), "levels_v[1]"),
        (("record_periods = 20", 'record_periods = "twenty"'), "record_periods = 'twenty'"),
        (("record_periods = 20", "record_periods = true"), "record_periods = True"),
        (("[21.933, 26.807]", "[23.0, 24.2]"), "linear_frequency_hz = 24.37"),
        (
            ("record_periods = 20", "record_periods = 20\nharmonics = 50\nsettle.longest_periods = 30"),
            "longest_periods = 30",
        ),
        (("k1 = 2.0", 'k1 = "2"'), "controller.k1 = '2'"),
        (("record_periods = 20", "record_periods = 0"), "greater than or equal to 4"),
        (("k2 = 6.283185307179586", "k2 = -1"), "controller.k2 = -1"),
        (("k2 = 6.283185307179586", ""), "controller.k2: is missing"),
        (("[21.933, 26.807]", "[25.0, 26.807]"), "frequency_window_hz"),
        (("[21.933, 26.807]", "[5.0, 26.807]"), "the bench magnet-beam allows"),
        (('"magnet-beam"', '"nosuch"'), "there is no such bench"),
        (('"backbone"', '"backbones"'), "kind = 'backbones'"),
        (('"backbone"', "backbone"), "is not TOML"),
    ],
)
def test_a_bad_plan_is_refused_with_path_value_and_what_is_allowed(command, tmp_path, change, named):
    (tmp_path / "plan.toml").write_text(PLAN.replace(*change, 1))
    code, _, err = command("run plan.toml -o run.h5")
    assert code == 1
    assert named in err
    assert len(err.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["plan.toml"]


def test_an_existing_model_is_not_overwritten_unasked(command, recording, tmp_path):
    (tmp_path / "model.h5").write_text("precious")
    status, _, err = command(f"identify {recording} -o model.h5")
    assert status == 1
    assert "exists already" in err
    assert (tmp_path / "model.h5").read_text() == "precious"
    assert command(f"identify {recording} -o model.h5 --overwrite")[0] == 0


def test_a_bench_of_ones_own_starts_from_a_shipped_one(command, tmp_path):
    (tmp_path / "mine.toml").write_text(
        'base = "magnet-beam"\nname = "mine"\n[limits]\nvoltage_v = 0.5\n[driver.options]\nnoise_scale = 0.0\n'
    )
    (tmp_path / "plan.toml").write_text(PLAN)
    status, _, err = command("run plan.toml -o run.h5 --bench mine.toml")
    assert status == 1
    assert "levels_v[1] = 0.8 V: the bench mine allows up to 0.5 V" in err
    (tmp_path / "bad.toml").write_text('base = "nosuch"\n')
    assert "base = 'nosuch'" in command("run plan.toml -o run.h5 --bench bad.toml")[2]


def test_facts_of_the_bench_that_are_not_those_of_its_virtual_rig_are_remarked(command, tmp_path):
    (tmp_path / "odd.toml").write_text('base = "magnet-beam"\n[specimen]\ndrive_mode_shape = 0.7\n')
    (tmp_path / "plan.toml").write_text(PLAN)
    status, _, err = command("run plan.toml -o run.h5 --bench odd.toml")
    assert status == 0
    assert "drive_mode_shape = 0.7: the virtual specimen has 0.908466" in err


def test_debug_shows_the_traceback(command):
    from rig.errors import RecordingError

    with pytest.raises(RecordingError):
        command("show missing.h5 --debug")


def test_a_run_with_a_failed_point_exits_with_one(command, tmp_path):
    text = PLAN + "\n[settle]\nlongest_periods = 39\nphase_deg = 0.001\n"
    (tmp_path / "plan.toml").write_text(text)
    status, out, err = command("run plan.toml -o run.h5")
    assert status == 1
    assert "0 of 2 points accepted" in out
    assert "2 of 2 points skipped: not-settled (0.4 V, 0.8 V)" in out.splitlines()
    assert "2 of 2 points skipped: not-settled (0.4 V, 0.8 V)" in command("show run.h5")[1].splitlines()
    assert err.count("  not-settled: not settled within 39 periods") == 2
    assert command("identify run.h5 -o model.h5")[0] == 1
    assert not (tmp_path / "model.h5").exists()
    assert command("plot run.h5 -o run.png")[0] == 0


def test_a_later_schema_is_named(command, recording, tmp_path):
    import shutil

    import h5py

    shutil.copy(recording, tmp_path / "later.h5")
    with h5py.File(tmp_path / "later.h5", "r+") as file:
        file.attrs["schema"] = 99
    status, _, err = command("show later.h5")
    assert status == 1
    assert "99" in err


def test_the_help_needs_none_of_the_heavy_libraries():
    code = (
        "import sys; sys.argv = ['rig', '--help']\n"
        "from rig.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numba', 'scipy', 'h5py', 'matplotlib', 'pydantic', 'numpy') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "identify" in done.stdout


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("-o plan.toml --recording plan.toml", "--recording plan.toml: recordings are written as .h5"),
        ("-o plan.h5", "-o plan.h5: plans are written as .toml"),
    ],
)
def test_a_tuning_writes_plan_and_recording_under_names_of_their_own(command, names, said):
    status, _, err = command(f"tune --bench magnet-beam {names}")
    assert status != 0
    assert said in err
