"""Spellings of units of time, rates and factors; units of columns; other kinds of mappings, which line up nothing."""

from pathlib import Path

import numpy as np
import openpyxl
import pytest
import scipy.io
import soundfile
from nptdms import ChannelObject, TdmsWriter

from identification import TimeRecords
from rig.errors import RigError
from rig.exchange.beside import facts_beside
from rig.exchange.file_data import FileData
from rig.exchange.foreign.arrays import read_workbook
from rig.exchange.foreign.channels import read_wav
from rig.exchange.proposal.contents import contents_of
from rig.exchange.proposal.proposal import _proposal
from rig.exchange.reading import import_file
from rig.exchange.spellings import factor_remark, rate_named, time_unit_in

RANDOM = np.random.default_rng(5)
ROWS = RANDOM.normal(size=(400, 2))
HAMMER = """
kind = "hammer-test"
channels = [
  { name = "f", role = "force", unit = "N", value = "d/F" },
  { name = "a", role = "drive", unit = "m/s2", value = "d/a" },
]
"""


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *((name, "ms") for name in ("time.ms", "Time-ms", "TIME_MS", "timems", "msec", "t_ms_rel", "rec/time_millis")),
        *(("t_us", "us"), ("timestamp ns", "ns"), ("time_min", "min"), ("t_s", "s"), ("Time h", "h"), ("seconds", "s")),
        *((name, "") for name in ("t", "time", "min", "run_s/time", "t_status", "times", "x_value", "h", "thumbs")),
    ],
)
def test_a_word_that_is_a_unit_of_time_counts_in_the_names_of_instants(name, unit):
    assert time_unit_in(name) == unit


@pytest.mark.parametrize(
    ("key", "value", "rate"),
    [
        *((key, 2048.0, 2048.0) for key in ("fs", "Fs", "f_s", "SampleRate", "sampling-frequency", "Sample Rate [Hz]")),
        *(
            ("fs_kHz", 2.048, 2048.0),
            ("dt", 0.5, 2.0),
            ("Delta T (ms)", 0.5, 2000.0),
            ("wf_increment", np.float32(0.25), 4.0),
        ),
        *((key, 3.0, None) for key in ("rate", "f", "sr", "fsd", "dtype", "full scale")),
        *((("fs", value, None)) for value in (0.0, -1.0, np.nan, True, "2048", np.ones(2))),
    ],
)
def test_a_single_number_is_a_rate_by_its_key(key, value, rate):
    assert rate_named(key, value) == pytest.approx(rate)


def test_a_factor_that_changes_nothing_is_none():
    assert factor_remark("Gain", 1.0, "the property") == factor_remark("offset", 0.0, "") == ""
    assert factor_remark("scale", "linear", "") == factor_remark("gained", 4.0, "") == ""
    assert "has the property Sensitivity (10 mV/g)" in factor_remark("Sensitivity", "10 mV/g", "the property")


def test_a_list_of_units_belongs_to_a_matrix_that_has_as_many_columns():
    units = ["kN", "g"]
    found = facts_beside(
        {"x/data": ROWS, "x/F": ROWS[:, 0], "y/data": ROWS, "x/units": units, "u": [1, 2], "units": "SI"}
    )
    assert {name: [*facts.columns] for name, facts in found.items()} == {"x/data": units}
    data = FileData(values={"x": ROWS.T}, channels={"x": found["x/data"]})
    assert [data.unit("x"), data.unit("x[0]"), data.unit("x[1]"), data.unit("x[2]")] == ["", "kN", "g", ""]


def test_columns_with_units_are_proposed_as_channels_with_these_units():
    data = FileData(
        values={"data": ROWS, "units": ["kN", "g"]}, channels=facts_beside({"data": ROWS, "units": ["kN", "g"]})
    )
    found = _proposal([contents_of(data)], Path("x.mat"), None).channels
    assert [(one.role, one.unit, one.axes, one.index) for one in found] == [
        ("force", "kN", ("sample", "channel"), 1),
        ("drive", "g", ("sample", "channel"), 2),
    ]


def test_columns_of_several_units_are_no_records_of_one_channel(tmp_path):
    scipy.io.savemat(tmp_path / "x.mat", {"data": ROWS, "units": np.array(["kN", "g"], dtype=object)})
    (tmp_path / "m.toml").write_text(
        'kind = "time-data"\nsample_rate_hz = 2048.0\n'
        '[[channels]]\nname = "f"\nrole = "response"\nunit = "g"\nvalue = "data"\n'
    )
    with pytest.raises(RigError, match=r"'data' has several units \(kN, g\); name the dimension `channel`"):
        import_file(tmp_path / "x.mat", mapping=tmp_path / "m.toml")


def test_units_of_structures_in_a_list_of_records_count(tmp_path):
    records = np.zeros(2, dtype=[(key, object) for key in ("F", "F_unit")])
    records[0], records[1] = (ROWS[:, 0], "kN"), (ROWS[:, 1], "kN")
    scipy.io.savemat(tmp_path / "x.mat", {"run": records})
    text = 'kind = "time-data"\nrecords = "run"\n[[channels]]\nname = "f"\nrole = "force"\nvalue = "F"\n'
    (tmp_path / "m.toml").write_text(f'{text}unit = "N"\n')
    with pytest.raises(RigError, match="the file's own units make it kN"):
        import_file(tmp_path / "x.mat", mapping=tmp_path / "m.toml")


def hammer(tmp_path: Path, text: str, late_s: float = 0.0, rate_hz: float = 1000.0) -> None:
    """Import a hammer test of TDMS."""
    begin = np.datetime64("2026-03-01T12:00:00.000000")
    later = begin + np.timedelta64(round(1e6 * late_s), "us")
    channels = [
        ChannelObject("d", name, values, {"wf_increment": 1.0 / rate_hz, "wf_start_time": at})
        for name, values, at in zip("Fa", ROWS.T, (begin, later), strict=True)
    ]
    with TdmsWriter(tmp_path / "x.tdms") as writer:
        writer.write_segment(channels)
    (tmp_path / "m.toml").write_text(text)
    import_file(tmp_path / "x.tdms", mapping=tmp_path / "m.toml")


def test_a_hammer_test_has_the_rate_of_its_file_or_is_refused(tmp_path):
    with pytest.raises(RigError, match=r"disagrees \(sample_rate_hz 2000 Hz, file \(d/F\) 1000 Hz"):
        hammer(tmp_path, f"sample_rate_hz = 2000.0\n{HAMMER}")
    with pytest.raises(RigError, match=r"begins 10\.00 samples after another"):
        hammer(tmp_path, HAMMER, late_s=0.01)
    with pytest.raises(RigError) as raised:  # noise, which is no hammer test
        hammer(tmp_path, f"against_file = true\nsample_rate_hz = 2000.0\n{HAMMER}", late_s=0.01)
    assert "disagrees" not in str(raised.value)
    assert "begins" not in str(raised.value)


def test_a_table_of_a_nonlinear_mode_has_the_units_of_its_columns(tmp_path):
    (tmp_path / "x.csv").write_text("f,d,x\nHz,%,mm\n20,1,1\n21,1,2\n22,1,3\n")
    text = 'kind = "nonlinear-mode"\nvalues = "peak"\nfrequency = "f"\ndamping = "d"\ndamping_unit = "%"\namplitude = "x"\n'
    (tmp_path / "m.toml").write_text(f'{text}amplitude_unit = "m"\n')
    with pytest.raises(RigError, match="`amplitude_unit` = 'm': the file's own units make it mm; write that"):
        import_file(tmp_path / "x.csv", mapping=tmp_path / "m.toml")
    (tmp_path / "m.toml").write_text(f'{text}amplitude_unit = "mm"\n')
    assert not isinstance(import_file(tmp_path / "x.csv", mapping=tmp_path / "m.toml"), TimeRecords)


def test_units_of_a_sheet_may_stand_above_its_names(tmp_path):
    book = openpyxl.Workbook()
    for row in (["Recorder"], ["ms", "kN", None], ["Time", "F", "n"], *([float(k), k + 0.5, 2.0] for k in range(5))):
        book.active.append(row)
    book.save(tmp_path / "x.xlsx")
    found = read_workbook(tmp_path / "x.xlsx")
    assert {name: found.unit(name) for name in found.values} == {"Time": "ms", "F": "kN", "n": ""}
    np.testing.assert_array_equal(found.values["F"], np.arange(5) + 0.5)


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
def test_full_scale_of_wav_files_is_1_as_libsndfile_has_it(tmp_path, subtype):
    soundfile.write(tmp_path / "x.wav", np.clip(0.3 * ROWS, -1.0, 1.0), 2048, subtype=subtype)
    reference, rate = soundfile.read(tmp_path / "x.wav", always_2d=True)
    found = read_wav(tmp_path / "x.wav")
    assert found.sample_rate_hz == rate
    np.testing.assert_allclose(np.column_stack([*found.values.values()]), reference, rtol=0.0, atol=1e-15)
