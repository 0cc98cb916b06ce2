"""Recordings as tables of pandas and xarray: the numbers of the recording, with units, in the stretch that was asked for."""

import builtins

import numpy as np
import pytest

import rig
from rig.campaigns.kinds import KINDS
from rig.errors import RecordingError
from tests.refused import refused
from tests.rig.cli.test_imports import PLAN

NEEDED = "is not installed (pip install 'vibrolock[tables]')"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    (folder / "plan.toml").write_text(PLAN.replace("record_periods = 20", 'record_periods = 20\nrows = "records"'))
    with rig.run(folder / "plan.toml", output=folder / "run.h5") as run:
        yield run


def test_points_are_a_table_with_the_columns_of_their_kind_and_units(run):
    pytest.importorskip("pandas", reason=f"pandas {NEEDED}")
    frame = run.to_pandas()
    assert list(frame.index) == [1, 2, 3]
    assert list(frame["level"]) == [0.4, 0.8, 1.2]
    assert {column.key for column in KINDS["backbone"].columns} <= set(frame.columns)
    backbone = run.backbone()
    np.testing.assert_array_equal(frame["frequency_hz"], backbone.frequency_hz)
    np.testing.assert_array_equal(frame["amplitude_m"], backbone.amplitude_m)
    assert frame["accepted"].all()
    units = frame.attrs["units"]
    assert [units[key] for key in ("level", "frequency_hz", "amplitude_m", "damping_ratio")] == ["V", "Hz", "m", "1"]
    assert set(units) == {"level", *(column.key for column in KINDS["backbone"].columns)}
    assert (frame.attrs["kind"], frame.attrs["bench"]) == ("backbone", "magnet-beam")


def test_rows_are_channels_over_time_at_the_instants_at_which_they_were_sampled(run):
    pytest.importorskip("xarray", reason=f"xarray {NEEDED}")
    data = run.to_xarray()
    (part,) = run.recording.parts
    assert data.sizes["time"] == part.n_rows
    np.testing.assert_array_equal(data["drive"], part.rows("inputs")[:, 1])
    assert [data[name].attrs["units"] for name in ("force", "drive", "frequency_hz", "output_v")] == [
        "N",
        "m/s^2",
        "Hz",
        "V",
    ]
    assert data["force"].attrs["role"] == "force"
    assert data["time"].attrs["units"] == "s"
    steps = np.diff(data["time"]) * 5000.0
    assert set(np.unique(np.round(steps))) >= {1.0, 500.0}  # rows of records and telemetry, by the plan
    assert np.all(steps > 0.5)
    # The oscillator itself is the clock: its phase advances by its frequency.
    record = run.to_xarray(point=2)
    turned = np.diff(np.unwrap(record["theta_rad"].values.astype(float)))
    expected = 2.0 * np.pi * record["frequency_hz"].values[1:] * np.diff(record["time"].values)
    np.testing.assert_allclose(turned, expected, atol=1e-5)


def test_a_point_alone_is_its_record_with_its_amplitude(run):
    pytest.importorskip("xarray", reason=f"xarray {NEEDED}")
    for number, point in enumerate(run.backbone().points, 1):
        record = run.to_xarray(point=number, columns=["force", "theta_rad"])
        assert set(record.data_vars) == {"force", "theta_rad"}
        turns = (record["time"][-1] - record["time"][0]) * point.frequency_hz
        assert float(turns) == pytest.approx(20.0, abs=1.1)
        whole = record.isel(time=slice(0, round(20 / point.frequency_hz * 5000.0)))
        amplitude = 2.0 * abs(np.mean(whole["force"].values * np.exp(-1j * whole["theta_rad"].values.astype(float))))
        assert amplitude == pytest.approx(point.force_n, rel=0.01)


def test_a_stretch_of_time_and_one_row_of_several_are_parts_of_the_whole(run):
    pytest.importorskip("xarray", reason=f"xarray {NEEDED}")
    whole = run.to_xarray(columns=["drive"])
    from_s, to_s = (float(whole["time"][at]) for at in (2000, 4000))
    some = run.to_xarray(columns=["drive"], from_s=from_s, to_s=to_s, every=7)
    np.testing.assert_array_equal(some["drive"], whole["drive"][2000:4000:7])
    np.testing.assert_array_equal(some["time"], whole["time"][2000:4000:7])
    assert run.to_xarray(from_s=1e6).sizes["time"] == 0


@pytest.mark.parametrize(
    ("wanted", "fault"),
    [
        ({"columns": ["drvie"]}, {"says": "there-are-force-drive-acc-drive", "field": "columns", "value": "drvie"}),
        ({"part": 2}, {"says": "has-parts-counted-from", "field": "part", "value": 2}),
        ({"part": 0}, {"says": "has-parts", "field": "part", "value": 0}),
        ({"point": 4}, {"says": "has", "field": "point", "value": 4}),
        ({"every": 0}, {"field": "every", "value": 0, "allowed": "1 and above"}),
    ],
)
def test_what_is_not_there_is_refused_in_one_line(run, wanted, fault):
    pytest.importorskip("xarray", reason=f"xarray {NEEDED}")
    with refused(RecordingError, **fault):
        run.to_xarray(**wanted)


@pytest.mark.parametrize(("library", "table"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_without_the_library_one_line_says_how_to_get_it(run, library, table, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **further):
        if name.partition(".")[0] == library:
            raise ModuleNotFoundError(name)
        return real(name, *arguments, **further)

    monkeypatch.setattr(builtins, "__import__", without)
    with refused(ImportError, "is-not-installed-tables") as caught:
        getattr(run, table)()
    assert library in str(caught.value)
