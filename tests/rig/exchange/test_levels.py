"""Levels of a multisine in universal files, in ASCII and binary, and time data in memory as SDyPy has them."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyuff

import rig
from rig.campaigns.plans import plan_from
from rig.errors import ConfigurationError, RecordingError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.export import export_file
from rig.exchange.reading import import_file, import_sep005
from rig.measurements.sep005 import time_series
from tests.refused import refused
from tests.rig.exchange.test_universal_files import response, units, written

CHANNELS = (("force", "force", "N"), ("drive", "drive", "m/s2"), ("acc_drive", "response", "m/s2"))
CHANNELS += (("acc_magnet", "response", "m/s2"),)
DIGITS = {"": 1e-11, "ascii": 1e-11, "binary": 0.0}  # relative; 12 digits of each part


@pytest.fixture(scope="session")
def matrices(multisine_file):
    with rig.Recording(multisine_file) as recording:
        return rig.measurements.response_matrices(recording)


def mapping(folder: Path, records: list[int] | None, voltage: str) -> Path:
    """A mapping of the time data of the multisine in ``multisine_file``."""
    text = 'kind = "multisine"\nperiod_samples = 10000\nlowest_hz = 22.0\nhighest_hz = 28.0\n'
    text += f'instrument = "{voltage}"\n' + (f"records = {records}\n" if records else "")
    for name, role, unit in (*CHANNELS, (voltage, "monitor", "V")):
        text += f'[[channels]]\nname = "{name}"\nrole = "{role}"\nunit = "{unit}"\nvalue = "{name}"\n'
    (folder / "mapping.toml").write_text(text)
    return folder / "mapping.toml"


@pytest.mark.parametrize("encoding", DIGITS)
def test_every_level_of_a_multisine_comes_back(multisine_file, matrices, encoding, tmp_path):
    path = tmp_path / "levels.uff"
    export_file(multisine_file, path, "uff", encoding=encoding)
    for number, matrix in enumerate(matrices.values(), 1):
        found = import_file(path, item=number)
        np.testing.assert_allclose(found.value, matrix.value, rtol=DIGITS[encoding] or 3e-16)
        np.testing.assert_allclose(found.frequency_hz, matrix.frequency_hz, rtol=1e-12)
        assert found.input_rms == matrix.input_rms
        assert [channel.name for channel in found.outputs] == [channel.name for channel in matrix.outputs]
        assert found.estimator == matrix.estimator
    with refused(ImportFailed, "holds-objects-choose-by-item-to"):
        import_file(path)
    with refused(ImportFailed, "choose-by-item-to"):
        import_file(path, item=3)


def test_ascii_and_binary_are_what_they_say_and_pyuff_reads_the_same_from_both(multisine_file, tmp_path):
    sets = {}
    for encoding in ("ascii", "binary"):
        path = tmp_path / f"{encoding}.uff"
        export_file(multisine_file, path, "uff", data="time", points=(0,), encoding=encoding)
        assert (b"    58b" in path.read_bytes()) == (encoding == "binary")
        if encoding == "ascii":
            path.read_bytes().decode("ascii")
        sets[encoding] = [one for one in pyuff.UFF(str(path)).read_sets() if one["type"] == 58]
    assert len(sets["ascii"]) == len(sets["binary"]) == 5
    for one, other in zip(sets["ascii"], sets["binary"], strict=True):
        np.testing.assert_allclose(one["data"], other["data"], rtol=1e-11, atol=1e-15)
        np.testing.assert_allclose(one["x"], other["x"], rtol=1e-12)
        assert (one["id1"], one["rsp_node"], one["ordinate_axis_units_lab"]) == (
            *(other["id1"], other["rsp_node"], other["ordinate_axis_units_lab"]),
        )


def test_binary_keeps_every_bit_of_uneven_frequencies_where_ascii_keeps_six_digits(responses, tmp_path):
    from rig.exchange.conversion import encoded
    from rig.exchange.export import write_contents

    for encoding, digits in (("ascii", 1e-5), ("binary", 0.0)):
        path = tmp_path / f"{encoding}.uff"
        write_contents([encoded(responses)], path, "uff", encoding)
        for found, expected in zip(import_file(path), responses, strict=True):
            np.testing.assert_allclose(found.frequency_hz, expected.frequency_hz, rtol=digits)
            np.testing.assert_allclose(found.response, expected.response, rtol=max(digits, 1e-15))
    assert import_file(tmp_path / "ascii.uff")[0].frequency_hz[1] != responses[0].frequency_hz[1]


@pytest.mark.parametrize(("format_", "encoding"), [("mat", "ascii"), ("uff", "hex")])
def test_an_encoding_is_one_of_two_and_of_universal_files(multisine_file, format_, encoding, tmp_path):
    with refused(ConfigurationError, field="encoding", value=encoding, allowed="ascii or binary, of format uff"):
        export_file(multisine_file, tmp_path / f"out.{format_}", format_, encoding=encoding)


@pytest.mark.parametrize("encoding", ["", "ascii"])
def test_time_data_of_one_level_give_the_same_best_linear_approximation(multisine_file, matrices, encoding, tmp_path):
    path = tmp_path / "time.uff"
    export_file(multisine_file, path, "uff", data="time", encoding=encoding)
    for number, matrix in enumerate(matrices.values()):
        found = import_file(path, mapping=mapping(tmp_path, [2 * number + 1, 2 * number + 2], "voltage"))
        np.testing.assert_allclose(found.value, matrix.value, rtol=1e-10)
        np.testing.assert_allclose(found.noise_covariance, matrix.noise_covariance, rtol=1e-3, atol=1e-12)
    with refused(ImportFailed, "the-data-has-to", field="records"):
        import_file(path, mapping=mapping(tmp_path, [9], "voltage"))


def test_load_cases_of_another_program_are_taken_apart_where_a_response_is_there_twice(tmp_path):
    values = [np.full(20, 1.0 + case) for case in range(3)]
    path = written(tmp_path / "a.uff", units(), *(response(v, load_case_id=c) for c, v in enumerate(values)))
    for number, value in enumerate(values, 1):
        np.testing.assert_allclose(import_file(path, item=number).value[:, 0, 0], value)
    path = written(tmp_path / "b.uff", units(), *(response(v) for v in values))
    with refused(ImportFailed, "second-response-of-in-load-case"):
        import_file(path)


def test_sep005_has_the_recorded_signals_and_its_own_check_accepts_them(multisine_file):
    check = pytest.importorskip("sdypy_sep005.sep005", reason="sdypy-sep005 is not installed (pip install '.[dev]')")
    with rig.Recording(multisine_file) as recording:
        series = time_series(recording)
        check.assert_sep005(series)
        assert [(one["name"], one["unit_str"]) for one in series[:2]] == [("force", "N"), ("drive", "m/s^2")]
        assert [one.get("quantity") for one in series] == ["f", "a", "a", "a", None]
        part = recording.parts[0]
        np.testing.assert_array_equal(series[1]["data"], part.rows("inputs")[:, 1])
        assert {one["fs"] for one in series} == {5000.0}
        assert series[0]["start_timestamp"] == recording.started
        second = time_series(recording, point=2, columns=["force"])
        assert len(second) == 1
        assert second[0]["start_timestamp"] > recording.started
        with refused(RecordingError, field="columns", value="froce"):
            time_series(recording, columns=["froce"])


def test_columns_of_the_loop_and_rows_with_gaps_in_time(tmp_path, monkeypatch):
    check = pytest.importorskip("sdypy_sep005.sep005", reason="sdypy-sep005 is not installed (pip install '.[dev]')")
    with rig.run("magnet-beam/backbone-short", output=tmp_path / "run.h5") as run:
        series = run.to_sep005(point=1, columns=["drive", "frequency_hz"])
        assert (series[1]["unit_str"], series[1].get("quantity")) == ("Hz", None)
        monkeypatch.setattr(
            "rig.measurements.tables.StoredSamples.samples", lambda _, rows: np.where(rows < 100, rows, 10.0 * rows)
        )
        gaps = run.to_sep005(from_s=0.0, to_s=0.04, columns=["drive"])
    check.assert_sep005(series)
    check.assert_sep005(gaps)
    assert "fs" not in gaps[0]
    assert gaps[0]["time"][:3] == [0.0, 0.0002, 0.0004]
    assert gaps[0]["time"][100] == 0.2


def test_series_of_sep005_come_in_by_a_mapping_as_time_data_of_a_file_do(multisine_file, matrices, tmp_path):
    with rig.Recording(multisine_file) as recording:
        series = [one for point in (3, 4) for one in time_series(recording, point=point)]
    found = import_sep005(series, mapping(tmp_path, None, "output_v"))
    np.testing.assert_allclose(found.value, matrices[0.1].value, rtol=1e-12)
    by_time = [
        {**{k: v for k, v in one.items() if k != "fs"}, "time": (np.arange(len(one["data"])) / 5000.0).tolist()}
        for one in series
    ]
    np.testing.assert_allclose(import_sep005(by_time, tmp_path / "mapping.toml").value, found.value, rtol=1e-12)
    in_g = [
        {**one, "data": one["data"] / 9.80665, "unit_str": "g"} if one["unit_str"] == "m/s^2" else one for one in series
    ]
    np.testing.assert_allclose(import_sep005(in_g, tmp_path / "mapping.toml").value, found.value, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"data": [[1.0]]}, {"says": "series-data-has-shape"}),
        ({"data": "x"}, {"says": "series-data-allowed-is-list-of"}),
        ({"fs": None}, {"says": "series-fs-is-missing-and-so"}),
        ({"fs": -1.0}, {"field": "series[0].fs", "value": -1.0, "allowed": "a number above 0"}),
        ({"fs": None, "time": [0.0, 1.0, 3.0]}, {"says": "series-time-allowed-are-evenly-spaced"}),
        ({"name": 3}, {"field": "series[0].name", "value": 3, "allowed": "a text"}),
        ({"fs": 20.0}, {"says": "sample-rates-from-to-hz"}),
    ],
)
def test_series_that_do_not_follow_sep005_are_refused_in_one_line(change, fault, tmp_path):
    good = {"data": [1.0, 2.0, 3.0], "name": "force", "unit_str": "N", "fs": 10.0}
    with refused(ImportFailed, **fault):
        import_sep005([{**good, **change}, {**good, "name": "drive"}], mapping(tmp_path, None, "output_v"))
    with refused(ImportFailed, "series-allowed-is-list"):
        import_sep005(good, mapping(tmp_path, None, "output_v"))


def test_levels_are_told_apart_on_the_command_line(command, multisine_file):
    command("export", multisine_file, "-o", "levels.uff", "--encoding", "binary").succeeded()
    imported = command("import levels.uff -o second.h5 --item 2 --json").succeeded()
    assert json.loads(imported.out)["kind"] == "frequency-response-matrix"


def test_a_plan_of_one_level_is_one_object_as_before(tmp_path):
    table = {"kind": "multisine", "bench": "magnet-beam", "levels_rms_v": [0.05], "realisations": 1, "periods": 2}
    band = {"lowest_hz": 22.0, "highest_hz": 28.0, "resolution_hz": 0.5}
    rig.run(plan_from(table | band, "test"), output=tmp_path / "one.h5").close()
    export_file(tmp_path / "one.h5", tmp_path / "one.uff", "uff")
    assert import_file(tmp_path / "one.uff").value.shape == (13, 3, 1)
