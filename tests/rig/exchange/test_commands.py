"""``rig export`` and ``rig import`` as they are typed."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import rig
from identification import FrequencyResponseMatrix, ModalAnalysis, nonlinear_mode
from rig.exchange.conversion import encoded
from rig.exchange.export import write_contents
from rig.exchange.reading import import_file
from rig.results.files import load, save


def test_a_backbone_goes_to_mat_as_a_structure_with_units(command, backbone_file, backbone, tmp_path):
    status, out, err = command(f"export {backbone_file} --to mat -o backbone.mat")
    assert status == 0, err
    assert out.startswith("backbone: magnet beam")
    data = scipy.io.loadmat(tmp_path / "backbone.mat", simplify_cells=True)["backbone"]
    np.testing.assert_array_equal(data["force_n"], backbone.force_n)
    np.testing.assert_array_equal(data["harmonics"], [point.harmonics for point in backbone.points])
    assert [channel["name"] for channel in data["channels"]] == [channel.name for channel in backbone.channels]
    assert (data["units"]["force_n"], data["units"]["frequency_hz"]) == ("N", "Hz")
    assert all(len(name) <= 31 for name in [*data, *data["units"]])


@pytest.mark.parametrize("ending", ["mat", "csv"])
def test_a_backbone_that_comes_back_gives_the_same_nonlinear_mode(command, backbone_file, mode, tmp_path, ending):
    assert command(f"export {backbone_file} -o out.{ending}")[0] == 0
    status, out, err = command(f"import out.{ending} -o back.h5")
    assert status == 0, err
    assert out.startswith("measured-backbone of magnet beam (one-sided)\n2 points\n")
    again = nonlinear_mode(load(tmp_path / "back.h5"))
    np.testing.assert_array_equal(again.damping_ratio, mode.damping_ratio)
    np.testing.assert_array_equal(again.modal_frequency_hz, mode.modal_frequency_hz)


def test_a_modal_analysis_goes_out_with_its_responses_and_each_part_comes_back(command, modes, matrix, tmp_path):
    one_force = replace(
        matrix, value=matrix.value[:, :, :1], inputs=matrix.inputs[:1], input_rms=(), noise_covariance=None
    )
    save(ModalAnalysis(modes, one_force), tmp_path / "lin.h5")
    assert load(tmp_path / "lin.h5").modes.small_terms.tolist() == modes.small_terms.tolist()
    for ending, several in (("uff", "choose by --item 1 (modes) or 2 (responses)"), ("mat", "choose by --item 1 to 2")):
        status, out, err = command(f"export lin.h5 -o lin.{ending}")
        assert status == 0, err
        assert [line.split(":")[0] for line in out.splitlines()] == ["linear-modes", "frequency-response-matrix"]
        status, _, err = command(f"import lin.{ending} -o both.h5")
        assert (status, several in err) == (1, True), err
        for number in (1, 2):
            assert command(f"import lin.{ending} --item {number} -o {ending}{number}.h5")[0] == 0
        np.testing.assert_allclose(load(tmp_path / f"{ending}1.h5").modes.shapes, modes.shapes, rtol=6e-6)
        np.testing.assert_allclose(load(tmp_path / f"{ending}2.h5").value, one_force.value, rtol=2e-12, atol=1e-11)
    again = load(tmp_path / "mat1.h5").modes
    np.testing.assert_array_equal(again.accelerance([30.0, 200.0]), modes.accelerance([30.0, 200.0]))
    status, _, err = command("export lin.h5 -o lin.csv")
    assert (status, "choose by --item one of 1 (linear-modes, beam); 2 (frequency-response-matrix" in err) == (1, True)
    assert command("export lin.h5 --item 1 -o lin.csv")[0] == 0
    assert command("import lin.csv -o csv.h5")[0] == 0
    np.testing.assert_array_equal(load(tmp_path / "csv.h5").modes.small_terms, modes.small_terms)


def test_a_multisine_is_one_response_matrix_a_level(command, multisine_file, tmp_path):
    status, out, err = command(f"export {multisine_file} -o levels.uff")
    assert status == 0, err
    assert len(out.splitlines()) == 2
    status, _, err = command(f"export {multisine_file} -o levels.csv")
    assert status == 1
    assert "levels.csv: a CSV file holds one table, here are 2: choose by --item one of 1 (" in err
    status, out, err = command(f"export {multisine_file} -o second.uff --item 2 --json")
    assert status == 0, err
    assert json.loads(out)["written"][0]["kind"] == "frequency-response-matrix"
    assert command("import second.uff -o second.h5")[0] == 0
    found = load(tmp_path / "second.h5")
    assert isinstance(found, FrequencyResponseMatrix)
    with rig.Recording(multisine_file) as recording:
        spectra = rig.measurements.spectra(recording)[0.1]
    expected = spectra.frequency_response(found.outputs[0].name).value
    np.testing.assert_allclose(found.path(found.outputs[0].name), expected, rtol=1e-11)


def test_samples_that_go_out_and_in_give_the_same_responses(command, multisine_file, tmp_path):
    """Without the sensors' skew, which the shipped bench does not have."""
    with rig.Recording(multisine_file) as recording:
        first = next(iter(rig.measurements.spectra(recording).values()))
        bench = recording.configuration["bench"]
    status, _, err = command(f"export {multisine_file} --data time --point 1 --point 2 -o time.uff")
    assert status == 0, err
    channels = "".join(
        f'[[channels]]\nname = "{c.name}"\nrole = "{c.role}"\nunit = "{c.unit}"\nvalue = "{c.name}"\n'
        for c in first.channels
    )
    size = round(bench["sample_rate_hz"] / 0.5)
    (tmp_path / "map.toml").write_text(
        f'kind = "multisine"\nperiod_samples = {size}\nlowest_hz = 22.0\nhighest_hz = 28.0\ninstrument = "voltage"\n{channels}'
    )
    status, out, err = command("import time.uff --mapping map.toml -o responses.h5")
    assert status == 0, err
    assert "13 lines, 22 to 28 Hz" in out
    found = load(tmp_path / "responses.h5")
    drive = next(channel.name for channel in found.outputs if channel.role == "drive")
    np.testing.assert_allclose(found.path(drive), first.frequency_response(drive).value, rtol=1e-9)


def test_samples_are_those_of_the_recording(command, backbone_file, tmp_path):
    assert command(f"export {backbone_file} --data time --point 2 -o time.mat")[0] == 0
    data = scipy.io.loadmat(tmp_path / "time.mat", simplify_cells=True)["time_data"]
    with rig.Recording(backbone_file) as recording:
        rows = rig.measurements.point_rows(recording, 1)
    np.testing.assert_array_equal(data["samples"][:-1], rows["inputs"].T)
    np.testing.assert_array_equal(data["samples"][-1], rows["output_v"])
    assert data["channels"][-1]["unit"] == "V"


def test_a_model_goes_to_csv_for_a_spreadsheet(command, backbone_file, tmp_path):
    assert command(f"identify {backbone_file} -o model.h5")[0] == 0
    assert command("export model.h5 -o model.csv")[0] == 0
    lines = Path(tmp_path / "model.csv").read_text().splitlines()
    assert lines[0] == "# vibrolock: nonlinear-mode"
    assert dict(zip(lines[2].split(","), lines[3].split(","), strict=True))["damping_ratio"] == "1"


@pytest.mark.parametrize(
    ("line", "status", "named"),
    [
        ("export {file} -o x.xls", 1, "x.xls: the ending says no format; give --to, one of mat, uff, csv"),
        ("export {file} --to xls -o x", 1, "--to = 'xls'; allowed: mat, uff, csv"),
        ("export {file} --data raw -o x.mat", 1, "--data = 'raw'; allowed: results, time"),
        ("export {file} --data time --point 9 -o x.mat", 1, "point 9: nothing was recorded of it; there are 1, 2"),
        ("export {file} --data time --point 0 -o x.mat", 2, "--point"),
        ("export {file} --item 3 -o x.mat", 1, "--item = 3"),
        ("export missing.h5 -o x.mat", 1, "missing.h5"),
        ("export {file} -o nowhere/x.mat", 1, "there is no folder nowhere"),
        ("export {file}", 2, "--output"),
        ("import missing.mat -o x.h5", 1, "missing.mat: there is no such file"),
        ("import missing.uff -o x.h5", 1, "missing.uff: there is no such file"),
        ("import missing.csv -o x.h5", 1, "missing.csv: there is no such file"),
        ("import missing.dat -o x.h5", 1, "give --format"),
        ("import {file} --format mat -o x.h5", 1, "is no MAT file"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_no_file(command, backbone_file, tmp_path, line, status, named):
    code, out, err = command(line.format(file=backbone_file))
    assert (code, out) == (status, "")
    assert named in err
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_what_exists_is_kept_without_overwrite(command, backbone_file, tmp_path):
    (tmp_path / "out.mat").write_text("mine")
    status, _, err = command(f"export {backbone_file} -o out.mat")
    assert status == 1
    assert "--overwrite" in err
    assert (tmp_path / "out.mat").read_text() == "mine"
    assert command(f"export {backbone_file} -o out.mat --overwrite")[0] == 0
    assert (tmp_path / "out.mat").stat().st_size > 1000


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("ending", ["mat", "uff", "csv"])
def test_a_full_disk_is_named_and_leaves_nothing(command, backbone_file, tmp_path, monkeypatch, ending):
    real = Path.touch

    def onto_the_full_device(self, **how):
        if self.name.endswith(".vibrolock-part"):
            self.symlink_to("/dev/full")
        else:
            real(self, **how)

    monkeypatch.setattr(Path, "touch", onto_the_full_device)
    status, _, err = command(f"export {backbone_file} -o out.{ending}")
    assert status == 1
    assert f"out.{ending}: cannot be written ({os.strerror(errno.ENOSPC)}); nothing was changed" in err
    assert list(tmp_path.iterdir()) == []


def test_imported_modes_and_responses_are_shown_and_plotted_like_our_own(command, multisine_file, modes, tmp_path):
    write_contents([encoded(modes)], tmp_path / "modes.unv", "uff")
    assert command(f"export {multisine_file} --item 1 -o responses.uff")[0] == 0
    for name in ("modes.unv", "responses.uff"):
        status, _, err = command(f"import {name} -o {name}.h5")
        assert status == 0, err
        status, out, err = command(f"show {name}.h5")
        assert status == 0, err
        assert "m/s2/N" in out or "m/s^2/N" in out or "24.1235" in out
        assert command(f"plot {name}.h5 -o {name}.png")[0] == 0
        again = f"again.{name}"
        assert command(f"export {name}.h5 -o {again}")[0] == 0
    found, first = (import_file(tmp_path / name) for name in ("again.modes.unv", "modes.unv"))
    np.testing.assert_array_equal(found.shapes, first.shapes)
