"""Units and rates that stand elsewhere than in brackets at the end of a name: in it, above it, in comments, attributes."""

import h5py
import numpy as np
import pytest
import scipy.io
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import unit_in_name
from rig.exchange.foreign.attributes import facts_of_attributes
from rig.exchange.foreign.channels import read_mdf4, read_tdms
from rig.exchange.foreign.hdf5 import read_hdf5
from rig.exchange.mat import parsed_mat
from rig.exchange.proposal.contents import Leaf
from rig.exchange.proposal.proposal import _check_clocks
from rig.exchange.tables.guess import guessed_layout
from rig.exchange.tables.reading import read_table
from tests.refused import refused

ROWS = np.column_stack([np.arange(40) / 2.048, np.random.default_rng(3).normal(size=(40, 2))])


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *((f"Time{text}", "ms") for text in ("_ms", " ms", " / ms", "/ms", ", ms", " in ms", ": ms", " {ms}", " <ms>")),
        *(("[ms] Time", "ms"), ("Time [ms] relative", "ms"), ("F_kN", "kN"), ("rec.t_us", "us"), ("a / g", "g")),
        *(
            (name, "")
            for name in ("F_N", "a_g", "u_in", "node 1", "stats/min", "ch[0].data", "x[12]", "drums", "ms", "group/s")
        ),
    ],
)
def test_a_unit_in_a_name_counts_where_nothing_else_is_meant(name, unit):
    assert unit_in_name(name) == unit


@pytest.mark.parametrize(
    ("heading", "separator"),
    [
        ("ms,kN,g\nTime,Force,Acc\n", ","),
        ("# Time [ms],Force [kN],Acc [g]\n", ","),
        ("Time,Force,Acc\n# ms,kN,g\n", ","),
        ("# units: ms, kN, g\nTime,Force,Acc\n", ","),
        ("Time [ms]  Force [kN]  Acc [g]\n", "  "),
    ],
)
def test_units_above_names_and_in_comments_are_those_of_the_columns(tmp_path, heading, separator):
    lines = (separator.join(map(repr, row)) for row in ROWS.tolist())
    (tmp_path / "x.csv").write_text(heading + "\n".join(lines) + "\n")
    found = read_table(tmp_path / "x.csv", guessed_layout(tmp_path / "x.csv"))
    assert [found.unit(name) for name in found.values] == ["ms", "kN", "g"]
    np.testing.assert_array_equal(np.column_stack([*found.values.values()]), ROWS)


def test_a_row_of_names_that_are_units_as_well_stays_the_row_of_names(tmp_path):
    (tmp_path / "x.csv").write_text("s,V,A\ns,mV,mA\n" + "".join("{},{},{}\n".format(*row) for row in ROWS.tolist()))
    found = read_table(tmp_path / "x.csv")
    assert {name: found.unit(name) for name in found.values} == {"s": "s", "V": "mV", "A": "mA"}


def facts_in(path, **attributes):
    with h5py.File(path, "w") as file:
        file["F"] = ROWS[:, 1]
        for key, value in attributes.items():
            file["F"].attrs[key] = value
    return facts_of_attributes(read_hdf5(path).values).get("F")


@pytest.mark.parametrize("texts", [["kN"], [b"kN"], ["kN", "kN"]])
def test_a_list_of_one_unit_is_that_unit_and_of_several_is_refused(tmp_path, texts):
    kind = h5py.string_dtype() if isinstance(texts[0], str) else None
    assert facts_in(tmp_path / "x.h5", units=np.array(texts, dtype=kind)).unit == "kN"
    assert facts_in(tmp_path / "y.h5", Unit_Name="kN").unit == "kN"
    two = facts_in(tmp_path / "z.h5", units=np.array(["kN", "g"], dtype=h5py.string_dtype()))
    assert two.unit == ""
    assert "kN, g" in two.unread


@pytest.mark.parametrize(
    "key", ["gain", "Sensitivity", "scaling_factor", "conversion", "calibration_factor", "polarity"]
)
def test_what_seems_to_be_a_factor_is_refused_unless_it_changes_nothing(tmp_path, key):
    assert f"{key} (1000)" in facts_in(tmp_path / "x.h5", **{key: 1000.0}).unread
    assert facts_in(tmp_path / "y.h5", **{key: 1.0, "_FillValue": np.nan}) is None


def test_a_rate_beside_a_dataset_is_that_of_the_dataset(tmp_path):
    assert facts_in(tmp_path / "x.h5", sample_rate=2048).sample_rate_hz == 2048.0
    assert facts_in(tmp_path / "y.h5", dt=1.0 / 1024.0).sample_rate_hz == 1024.0


def test_numbers_that_netcdf_never_wrote_are_refused_and_scalars_are_read(tmp_path):
    with scipy.io.netcdf_file(str(tmp_path / "x.nc"), "w") as file:
        file.createDimension("n", 3)
        file.createVariable("F", "f4", ("n",))[:] = [1.0, 9.969209968386869e36, 2.0]
        file.createVariable("one", "f8", ())[...] = 4.0
    values = read_hdf5(tmp_path / "x.nc").values
    assert "1 values that were never written" in facts_of_attributes(values, netcdf=True)["F"].unread
    assert values["one"] == 4.0


def test_structures_of_signals_say_their_units_in_any_spelling(tmp_path):
    signals = np.zeros(2, dtype=[("name", object), ("unit", object), ("data", object)])
    signals[0], signals[1] = ("force", "kN", ROWS[:, 1]), ("acc", "g", ROWS[:, 2])
    whole = {"ch": signals, "m": {"F": ROWS[:, 1], "units": {"F": "lbf"}}, "a": ROWS[:, 2], "a_unit": "mm/s2"}
    scipy.io.savemat(tmp_path / "x.mat", whole)
    found = parsed_mat(tmp_path / "x.mat")
    assert [found.unit(path) for path in ("ch[0].data", "ch[1].data", "m.F", "a")] == ["kN", "g", "lbf", "mm/s2"]


def test_channels_over_an_angle_have_no_rate(tmp_path):
    with MDF(version="4.10") as file:
        file.append([Signal(ROWS[:, 1], ROWS[:, 0] * 1e-3, name="F", unit="kN")])
        file.groups[0].channels[0].sync_type = 2
        file.groups[0].channels[0].name = "angle"
        file.save(tmp_path / "x.mf4")
    assert "not a time" in read_mdf4(tmp_path / "x.mf4").channels["F"].unread


def test_units_of_tdms_may_have_other_names(tmp_path):
    with TdmsWriter(str(tmp_path / "x.tdms")) as writer:
        writer.write_segment([ChannelObject("g", "F", ROWS[:, 1], properties={"Units": "kN"})])
    assert read_tdms(tmp_path / "x.tdms").unit("g/F") == "kN"


def test_instants_of_two_rates_in_one_file_are_refused():
    one, two = Leaf("t1 [s]", ROWS[:, 0] * 1e-3, "s"), Leaf("t2 [ms]", ROWS[:, 0] * 2.0, "ms")
    _check_clocks([one, Leaf("t2 [ms]", ROWS[:, 0] + 5.0, "ms")])
    with refused(ImportFailed, "t-s-have-hz-t-ms"):
        _check_clocks([one, two])
