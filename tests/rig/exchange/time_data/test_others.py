"""Workbooks, archives, NetCDF, MATLAB's objects and ControlDesk's structures: what is in them, and what is refused."""

import sys
from random import Random

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.io

from rig.exchange.child_values import read_values
from rig.exchange.file_data import FileData
from rig.exchange.foreign.arrays import read_npz, read_workbook
from rig.exchange.foreign.hdf5 import read_hdf5
from rig.exchange.mat import parsed_mat
from rig.exchange.process import main
from rig.exchange.proposal.contents import contents_of
from tests.refused import refused
from tests.reliability.mutations.byte_mutations import BYTE_MUTATIONS
from tests.rig.exchange.time_data import files
from tests.rig.exchange.time_data.files import save_to_mat

COLUMN = np.random.default_rng(8).normal(size=20)


def test_sheets_of_a_workbook_have_names_units_and_numbers(tmp_path):
    book = openpyxl.Workbook()
    for title, unit in (("run 1", "[kN]"), ("run 2", "N")):
        sheet = book.create_sheet(title)
        sheet.append(["Recorder 1.2"])
        sheet.append(["F", None, "a"])
        sheet.append([unit, None, "g"])
        for value in COLUMN.tolist():
            sheet.append([value, None, 2.0 * value])
    book.save(tmp_path / "x.xlsx")
    found = read_workbook(tmp_path / "x.xlsx")
    assert list(found.values) == ["run 1/F", "run 1/a", "run 2/F", "run 2/a"]
    np.testing.assert_allclose(found.values["run 2/a"], 2.0 * COLUMN, rtol=1e-15)  # openpyxl prints 16 digits
    assert (found.unit("run 1/F"), found.unit("run 2/F"), found.unit("run 1/a")) == ("kN", "N", "g")


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        (None, {"says": "cell-b-is-empty"}),
        ("OVER", {"says": "cell-b-over-is-no-number"}),
        (True, {"says": "cell-b-true"}),
    ],
)
def test_a_cell_without_a_number_is_named(tmp_path, cell, message):
    book = openpyxl.Workbook()
    for row in (["t", "F"], ["s", "N"], *([value, 1.0] for value in COLUMN.tolist())):
        book.active.append(row)
    book.active["B7"] = cell
    book.save(tmp_path / "x.xlsx")
    with refused(ValueError, **message):
        read_workbook(tmp_path / "x.xlsx")


def test_an_archive_with_objects_is_refused_and_runs_nothing(tmp_path):
    np.savez(tmp_path / "x.npz", F=np.array([{"a": 1}], object))
    with refused(ValueError, "allow-pickle"):
        read_npz(tmp_path / "x.npz")


def test_texts_of_an_archive_are_units_of_their_arrays(tmp_path):
    np.savez(tmp_path / "x.npz", F=COLUMN, F_unit="kN", names=np.array(["a", "b"]))
    found = read_npz(tmp_path / "x.npz")
    assert (found.unit("F"), found.values["names"]) == ("kN", ["a", "b"])


def test_rattlesnakes_channels_have_nodes_units_and_a_rate(tmp_path):
    with h5py.File(tmp_path / "x.nc4", "w") as file:
        file["time_data"] = np.stack([COLUMN, 2.0 * COLUMN])
        file.attrs["sample_rate"] = np.int64(5120)
        for name, texts in {"unit": ["lbf", "g"], "node_number": ["1", "12"], "node_direction": ["Z+", "X-"]}.items():
            file.create_dataset(f"channels/{name}", data=texts, dtype=h5py.string_dtype())
    found = read_hdf5(tmp_path / "x.nc4")
    leaves = contents_of(found).arrays
    assert [(leaf.path, leaf.name, leaf.unit) for leaf in leaves] == [
        ("time_data[0]", "1Z+", "lbf"),
        ("time_data[1]", "12X-", "g"),
    ]
    np.testing.assert_array_equal(leaves[1].values, 2.0 * COLUMN)
    assert found.sample_rate_hz == 5120.0


def table(start: object) -> pd.DataFrame:
    index = pd.to_timedelta(np.arange(20) * 1953125, unit="ns").rename("Time")
    found = pd.DataFrame({"F": COLUMN, "a": 2.0 * COLUMN}, index=index if start is None else index + start)
    found.attrs["varUnits"] = ["kN", "g"]
    return found


@pytest.mark.filterwarnings("ignore")  # mat-io writes in seconds what is in nanoseconds, and says so
@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.parametrize("start", [None, pd.Timestamp("2026-02-03 10:00")], ids=["durations", "dates"])
def test_a_timetable_is_a_structure_of_its_variables_and_seconds(tmp_path, version, start):
    save_to_mat(str(tmp_path / "x.mat"), {"data": table(start), "fs": 512.0, "b": COLUMN}, version=version)
    found = parsed_mat(tmp_path / "x.mat")
    data = found.values["data"]
    assert isinstance(data, dict)
    np.testing.assert_array_equal(data["a"], 2.0 * COLUMN)
    np.testing.assert_allclose(data["Time"], np.arange(20) / 512.0, atol=5e-7)  # dates are milliseconds since 1970
    np.testing.assert_array_equal(found.values["b"], COLUMN)
    assert found.unit("data.Time") == "s"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_without_mat_io_a_line_says_how_matlab_saves_it_readably(tmp_path, monkeypatch, version):
    save_to_mat(str(tmp_path / "x.mat"), {"data": table(None)}, version=version)
    monkeypatch.setitem(sys.modules, "matio", None)
    with refused(ValueError, "data-is-a-matlab-timetable-vibrolock") as caught:
        parsed_mat(tmp_path / "x.mat")
    assert "\n" not in str(caught.value)


def test_structures_of_controldesk_name_their_signals(tmp_path):
    signals = [{"Name": "Force", "Unit": "N", "Data": COLUMN}, {"Name": "Acc", "Unit": "m/s^2", "Data": 2.0 * COLUMN}]
    recording = {"X": {"Name": "time", "Unit": "s", "Data": np.arange(20) / 512.0}, "Y": np.array(signals, object)}
    scipy.io.savemat(tmp_path / "x.mat", {"rec": recording, "Fs": 512.0})
    leaves = contents_of(parsed_mat(tmp_path / "x.mat")).arrays
    told = [(leaf.path, leaf.name, leaf.unit) for leaf in leaves]
    assert ("rec.Y[0].Data", "Force", "N") in told
    assert ("rec.Y[1].Data", "Acc", "m/s^2") in told
    assert ("rec.X.Data", "time", "s") in told


def cells(*entries: object) -> np.ndarray:
    found = np.empty(len(entries), object)
    found[:] = [*entries]
    return found


@pytest.mark.parametrize(
    ("runs", "value"),
    [(({"F": COLUMN}, {"F": 2.0 * COLUMN}), "F"), ((np.outer(COLUMN, [1, 2]), np.outer(COLUMN[:9], [3, 4])), ".")],
    ids=["structures", "matrices"],
)
def test_cells_of_runs_are_records_and_what_lies_beside_is_listed(tmp_path, runs, value):
    stored = {"runs": cells(*runs)}
    scipy.io.savemat(tmp_path / "x.mat", {"test": stored, "Fs": 512.0, "ChanNames": cells("F", "a")})
    found = contents_of(parsed_mat(tmp_path / "x.mat"))
    assert (found.records, [leaf.path for leaf in found.arrays]) == ("test.runs", [value])
    assert found.beside is not None
    assert found.beside.single == {"Fs": 512.0}
    assert "ChanNames" in found.beside.others


SPOILT = {"labview.lvm": "lvm", "archive.npz": "npz", "book.xlsx": "xlsx", "classic.nc": "hdf5", "table.csv": "csv"}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SPOILT)
def test_spoilt_files_are_read_or_refused_in_one_line(tmp_path, monkeypatch, name):
    for key, value in {"N": 60, "INSTANTS": files.INSTANTS[:60], "FORCE": files.FORCE[:60]}.items():
        monkeypatch.setattr(files, key, value)
    monkeypatch.setattr(files, "ACCELERATION", files.ACCELERATION[:60])
    files.FILES[name][0](tmp_path / name)
    whole, told = (tmp_path / name).read_bytes(), set[bool]()
    for number in range(60):
        chance = Random(number)
        (tmp_path / name).write_bytes(chance.choice(BYTE_MUTATIONS)(whole, chance))
        why = main(SPOILT[name], {}, tmp_path / name, tmp_path)
        assert "\n" not in why
        told.add(bool(why))
        if not why:
            assert isinstance(read_values(tmp_path), FileData)
    assert True in told
