"""``rig predict`` as it is typed: numbers against the rig's own, files, figures, and one line for every mistake."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest

from identification import predict_sweep
from rig.measurements import sweeps
from rig.recording.reader import Recording
from rig.results.files import load, save
from rig.results.measured import modes_in
from simulators import VirtualRig
from simulators.analysis import constant_force_response

ALL = (
    "NM.h5 --frequency-response 0.1 --frequency-response 0.15 --sweep sweep.h5 --exciter EX.h5 --modes LIN.h5 "
    "--reference stepped.h5"
)


@pytest.fixture
def at_shelf(command, shelf, monkeypatch, tmp_path):
    """Commands typed in the folder of the recordings; what they write goes elsewhere."""

    def typed(line):
        monkeypatch.chdir(shelf)
        return command(f"{line} -o {tmp_path}/P.h5")

    return typed


@pytest.fixture
def summary(at_shelf):
    done = at_shelf(f"predict {ALL} --json")
    assert done.status == 0, done.err
    return json.loads(done.out)


def test_peaks_at_constant_force_are_those_of_the_rig(summary):
    for response in summary["frequency_responses"][:2]:
        truth = constant_force_response(VirtualRig.shipped("magnet-beam"), response["force_n"])
        amplitude = np.abs(truth.drive_harmonics_m[:, 1])
        top = int(np.argmax(amplitude))
        assert response["peak_m"] == pytest.approx(amplitude[top], rel=0.01)
        assert response["peak_frequency_hz"] == pytest.approx(truth.frequency_hz[top], rel=1e-4)
        assert 0.0 < response["peak_std_m"] < 0.01 * response["peak_m"]
        assert response["range_use"] < 1.0


def test_stepped_sines_and_both_sweeps_are_predicted_within_one_percent(summary):
    stepped, *swept = summary["errors"]
    assert [error["name"] for error in summary["errors"]] == ["0.6 V", "sweep [1]", "sweep [2]"]
    assert stepped["envelope_error"] < 0.01
    for error in swept:
        assert abs(error["peak_error"]) < 0.01
        assert error["envelope_error"] < 0.01
        assert error["verdict"] == "inside the identified range"
    assert summary["sweeps"][0]["origin"] == "recorded voltage"
    assert summary["notes"] == []


def test_the_file_holds_what_was_predicted(at_shelf, shelf, tmp_path):
    assert at_shelf(f"predict {ALL}").status == 0
    held = load(tmp_path / "P.h5")
    with Recording(shelf / "sweep.h5") as recording:
        sweep = sweeps(recording)[1]
    again = predict_sweep(
        load(shelf / "NM.h5"), sweep, exciter=load(shelf / "EX.h5"), linear_modes=modes_in(shelf / "LIN.h5")
    )
    np.testing.assert_array_equal(held.sweeps[1].drive_m, again.drive_m)
    np.testing.assert_array_equal(held.sweep_references[1].force, sweep.force)
    assert held.steady_references[:2] == (None, None)
    assert held.steady_bands[0].draws == 40
    assert held.steady[0].channels[0] == "drive"


def test_a_file_of_predictions_is_shown_and_drawn(at_shelf, command, tmp_path):
    made = at_shelf(f"predict {ALL}")
    shown = command(f"show {tmp_path}/P.h5")
    assert shown.out == made.out
    for text in ("0.15 N", "recorded voltage", "sweep [2]", "holds for the exciter of magnet-beam"):
        assert text in shown.out
    assert command(f"plot {tmp_path}/P.h5 -o {tmp_path}/P.png").status == 0
    assert (tmp_path / "P.png").stat().st_size > 50_000


def test_a_figure_replaces_no_folder_and_not_its_own_source(command, shelf, tmp_path):
    shutil.copy(shelf / "NM.h5", tmp_path / "model.png")
    before = (tmp_path / "model.png").read_bytes()
    done = command(f"plot {tmp_path}/model.png -o {tmp_path}/model.png")
    assert done.status != 0
    assert "model.png: " in done.err
    assert (tmp_path / "model.png").read_bytes() == before
    (tmp_path / "folder.png").mkdir()
    done = command(f"plot {shelf}/NM.h5 -o {tmp_path}/folder.png")
    assert done.status != 0
    assert "folder.png: is a folder" in done.err


def test_a_sweep_that_is_yet_to_be_made_is_the_one_that_is_then_recorded(at_shelf, tmp_path):
    (tmp_path / "plan.toml").write_text(
        'kind = "sweep"\nbench = "magnet-beam"\nstart_hz = 18.0\nstop_hz = 34.0\nrate_hz_per_s = 2.0\n'
        "levels_v = [0.4, 0.9]\n"
    )
    models = "--exciter EX.h5 --modes LIN.h5"
    done = at_shelf(f"predict NM.h5 --planned-sweep {tmp_path}/plan.toml --sweep sweep.h5 {models} --json")
    assert done.status == 0, done.err
    recorded, planned = np.split(np.array([s["peak_m"] for s in json.loads(done.out)["sweeps"]]), 2)
    np.testing.assert_allclose(planned, recorded, rtol=2e-3)
    names = [s["name"] for s in json.loads(done.out)["sweeps"]]
    assert names[2:] == [f"planned {v} V, 18 to 34 Hz, 2 Hz/s" for v in (0.4, 0.9)]


@pytest.mark.parametrize(
    ("options", "origin"),
    [
        ("", "demodulation"),
        (" --zero-crossings half-periods", "zero crossings"),
        (" --zero-crossings periods", "zero crossings"),
    ],
)
def test_without_an_exciter_the_recorded_force_is_imposed(at_shelf, options, origin):
    done = at_shelf(f"predict NM.h5 --sweep sweep.h5{options} --allow-extrapolation --json")
    assert done.status == 0, done.err
    assert {s["origin"] for s in json.loads(done.out)["sweeps"]} == {f"force by {origin}"}


def test_a_comparison_over_phase_tells_the_same_peaks(at_shelf):
    by = {}
    for over in ("frequency", "phase"):
        done = at_shelf(f"predict NM.h5 --reference stepped.h5 --over {over} --overwrite --json")
        (by[over],) = json.loads(done.out)["errors"]
    assert by["phase"]["peak_error"] == by["frequency"]["peak_error"]
    assert by["phase"]["envelope_error"] != by["frequency"]["envelope_error"]
    assert by["phase"]["envelope_error"] < 0.02


def test_models_of_another_rig_are_noted(at_shelf):
    done = at_shelf("predict NM.h5 --planned-sweep friction-beam/sweep-1 --exciter EX.h5 --json")
    assert done.status == 0, done.err
    specimen, exciter = json.loads(done.out)["notes"]
    assert "not the same specimen" in specimen
    assert "right only if" in exciter


def test_an_extrapolation_that_was_allowed_is_flagged(at_shelf):
    done = at_shelf("predict NM.h5 --frequency-response 2 --allow-extrapolation --json")
    (response,) = json.loads(done.out)["frequency_responses"]
    assert response["range_use"] > 2.0
    assert any("not to be trusted" in note for note in response["notes"])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "NM.h5",
            "nothing to predict: give --frequency-response, --voltage-response, --sweep, ",
        ),
        ("nothing.h5 --frequency-response 0.1", "nothing.h5"),
        (
            "LIN.h5 --frequency-response 0.1",
            "LIN.h5: is a file of kind linear-modes; predictions are made with a nonlinear-mode, ",
        ),
        ("NM.h5 --frequency-response 0", "--frequency-response = 0: allowed is any number above 0, N"),
        ("NM.h5 --frequency-response nan", "--frequency-response = nan: allowed is any number above 0, N"),
        ("NM.h5 --frequency-response -0.1", "--frequency-response = -0.1: allowed is any number above 0, N"),
        ("NM.h5 --frequency-response 1e-12", "force_n = 1e-12 N: too small"),
        (
            "NM.h5 --frequency-response 2",
            "measure higher levels, or allow extrapolation (--allow-",
        ),
        ("NM.h5 --frequency-response 0.1 --force peak", "--force = 'peak': allowed are fundamental, rms, pure-sine"),
        ("NM.h5 --reference stepped.h5 --over time", "--over = 'time': allowed are frequency, phase"),
        ("NM.h5 --frequency-response 0.1 --exciter EX.h5", "--exciter: is for sweeps, and none is given"),
        ("NM.h5 --sweep sweep.h5 --zero-crossings all", "--zero-crossings = 'all': allowed are half-periods, periods"),
        ("NM.h5 --frequency-response 0.1 --zero-crossings periods", "--zero-crossings: is for recorded sweeps"),
        (
            "NM.h5 --sweep sweep.h5 --exciter EX.h5 --zero-crossings periods",
            "--zero-crossings: are those of an imposed force",
        ),
        (
            "NM.h5 --sweep sweep.h5 --exciter LIN.h5",
            "LIN.h5: is a file of kind linear-modes, expected one of kind exciter",
        ),
        (
            "NM.h5 --sweep sweep.h5 --modes EX.h5",
            "EX.h5: is a file of kind exciter, expected one of kind linear-modes",
        ),
        ("NM.h5 --sweep backbone.h5", "holds a backbone, expected a sweep recording"),
        ("NM.h5 --reference sweep.h5", "sweep.h5: is a file of kind sweep; a reference is a stepped-sine recording"),
        ("NM.h5 --planned-sweep magnet-beam/sweep-1", "--planned-sweep: gives a voltage, which needs an exciter"),
        ("NM.h5 --planned-sweep magnet-beam/backbone --exciter EX.h5", "kind backbone, expected a sweep"),
        ("NM.h5 --planned-sweep nowhere.toml --exciter EX.h5", "nowhere.toml"),
        ("NM.h5 --planned-sweep magnet-beam/sweep-3 --exciter EX.h5", "modal amplitude: exceeds 2 times"),
    ],
)
def test_every_mistake_is_named_in_one_line_and_leaves_no_file(at_shelf, tmp_path, line, said):
    done = at_shelf(f"predict {line}")
    assert done.status != 0
    assert said in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (tmp_path / "P.h5").exists()


def test_a_logarithmic_plan_is_refused(at_shelf, tmp_path):
    (tmp_path / "log.toml").write_text(
        'kind = "sweep"\nbench = "magnet-beam"\nstart_hz = 18.0\nstop_hz = 34.0\nrate_octaves_per_min = 2.0\n'
        "levels_v = [0.4]\n"
    )
    done = at_shelf(f"predict NM.h5 --planned-sweep {tmp_path}/log.toml --exciter EX.h5")
    assert done.status != 0
    assert "rate_octaves_per_min: " in done.err


@pytest.mark.parametrize("accepted", [0, 1])
def test_of_an_incomplete_recording_what_was_accepted_is_predicted(at_shelf, shelf, tmp_path, accepted):
    shutil.copy(shelf / "sweep.h5", tmp_path / "cut.h5")
    with h5py.File(tmp_path / "cut.h5", "r+") as file:
        points = file["parts/0/points/json"]
        told = [json.loads(point) | {"accepted": index < accepted} for index, point in enumerate(points[:])]
        points[:] = [json.dumps(point) for point in told]
    done = at_shelf(f"predict NM.h5 --sweep {tmp_path}/cut.h5 --exciter EX.h5 --json")
    if not accepted:
        assert done.status != 0
        assert "none of the recording" in done.err
        return
    summary = json.loads(done.out)
    assert len(summary["sweeps"]) == 1
    assert "and predicted: 1" in summary["notes"][0]


def test_modes_of_another_specimen_are_refused(at_shelf, shelf, tmp_path):
    analysis = load(shelf / "LIN.h5")
    save(replace(analysis, modes=replace(analysis.modes, specimen="plate")), tmp_path / "other.h5")
    for line in (
        f"predict NM.h5 --frequency-response 0.1 --modes {tmp_path}/other.h5",
        f"predict NM.h5 --sweep sweep.h5 --exciter EX.h5 --modes {tmp_path}/other.h5",
        f"identify backbone.h5 --modes {tmp_path}/other.h5",
    ):
        done = at_shelf(line)
        assert done.status == 1
        assert "'plate'" in done.err
        assert "one specimen" in done.err


def test_a_file_that_is_given_twice_is_refused(at_shelf):
    done = at_shelf("identify backbone.h5 backbone.h5")
    assert done.status == 1
    assert "backbone.h5: is given twice" in done.err


def test_a_response_far_beyond_the_range_has_no_band(at_shelf):
    done = at_shelf("predict NM.h5 --frequency-response 1 --allow-extrapolation --json")
    response = json.loads(done.out)["frequency_responses"][0]
    assert response["range_use"] > 1.25
    assert not any(isinstance(value, float) for key, value in response.items() if "bound" in key or "std" in key)
