"""Times of day in tables, lines of numbers at their ends, responses of stepped sines in decibels, uneven universal files."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import pyuff
import scipy.io

from identification import IdentificationError
from identification.mapping import even_sampling
from rig.errors import RigError
from rig.exchange.reading import import_file
from rig.exchange.tables.clocks import in_seconds, is_clock
from rig.exchange.tables.guess import guessed_layout
from rig.exchange.tables.reading import read_table
from rig.exchange.uff.reading import datasets_in
from rig.exchange.uff.time_data import time_data_in
from tests.rig.exchange.time_data.files import N, universal

BEGIN = datetime(2026, 3, 1, 23, 58, 59, 125000, tzinfo=UTC)
VALUES = np.random.default_rng(4).normal(size=(200, 2)).round(6)


def written(path: Path, times: list[str], separator: str, unit: str = "") -> Path:
    rows = [separator.join([time, *map(str, row)]) for time, row in zip(times, VALUES.tolist(), strict=True)]
    units = [separator.join([unit, "N", "g"])] if unit else []
    path.write_text("\n".join([separator.join(["Time", "F", "a"]), *units, *rows]) + "\n")
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(
    ("form", "first"),
    [
        ("%Y-%m-%d %H:%M:%S.%f", BEGIN.timestamp()),
        ("%Y-%m-%dT%H:%M:%S.%fZ", BEGIN.timestamp()),
        ("%H:%M:%S.%f", 23 * 3600.0 + 58 * 60.0 + 59.125),
        ("%M:%S.%f", 58 * 60.0 + 59.125),
    ],
)
def test_times_of_day_are_instants_in_seconds(tmp_path, form, first, separator):
    times = [(BEGIN + timedelta(milliseconds=5 * k)).strftime(form) for k in range(len(VALUES))]
    path = written(tmp_path / "x.csv", times, separator, unit="hh:mm:ss")
    found = read_table(path, guessed_layout(path))
    assert found.unit("Time") == "s"
    np.testing.assert_allclose(found.values["Time"], first + 5e-3 * np.arange(len(VALUES)), rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(np.column_stack([found.values["F"], found.values["a"]]), VALUES)
    even = even_sampling(np.asarray(found.values["Time"]))
    assert even is not None
    assert even.rate_hz == 200.0


def test_what_is_no_time_of_day_stays_as_it_is():
    assert not any(map(is_clock, ("12:30", "1:2:3", "25:61:00", "a:b:c", "12:00:00:00", "1.5", "2026-03-01")))
    assert in_seconds("2026-02-30 10:00:00.5,1.25", ".") == "2026-02-30 10:00:00.5,1.25"
    assert in_seconds("00:00:01,5;2,5", ",") == "1,5;2,5"
    assert in_seconds("5,00:01:00,0:00:01.5,7:08", ".") == "5,60.0,1.5,7:08"


def test_lines_of_numbers_at_the_end_are_told_by_the_instants(tmp_path):
    path = written(tmp_path / "x.csv", [*map(str, np.arange(len(VALUES)) / 128.0)], ",")
    path.write_text(path.read_text() + "0.0,1.0,2.0\n1.5,3.0,4.0\n")
    text = 'kind = "time-data"\ntime = "Time"\n[[channels]]\nname = "F"\nrole = "force"\nunit = "N"\nvalue = "F"\n'
    (tmp_path / "m.toml").write_text(text)
    hint = "leave out the last 2, of a CSV file by `csv = { skip_last_lines = 2 }`"
    with pytest.raises(RigError) as raised:
        import_file(path, mapping=tmp_path / "m.toml")
    assert hint in str(raised.value)
    (tmp_path / "m.toml").write_text(f"csv = {{ skip_last_lines = 2 }}\n{text}")
    assert import_file(path, mapping=tmp_path / "m.toml").sample_rate_hz == 128.0


STEPPED = """
units = { frequency = "Hz", force = "N", response = "mm", values = "peak"%s }
phase = { unit = "deg", of = "displacement", sense = "response-minus-force" }
sets = [{ frequency = "f", force = "F", response = "x", phase = "p", controlled = "force" }]
"""


@pytest.mark.parametrize(("key", "unit"), [(', amplitude_unit = "dB"', ""), ("", "dB re 1 mm")])
def test_responses_of_stepped_sines_may_be_in_decibels(tmp_path, key, unit):
    amplitude = np.array([0.5, 2.0, 1.0])
    columns = {"f": np.arange(20.0, 23.0), "F": np.ones(3), "x": 20.0 * np.log10(amplitude), "p": np.zeros(3)}
    scipy.io.savemat(tmp_path / "x.mat", {**columns, **({"x_unit": unit} if unit else {})})
    (tmp_path / "m.toml").write_text(STEPPED % key)
    (found,) = import_file(tmp_path / "x.mat", mapping=tmp_path / "m.toml")
    np.testing.assert_allclose(np.abs(found.response), 1e-3 * amplitude)
    if not unit:
        (tmp_path / "m.toml").write_text(STEPPED % "")
        with pytest.raises((RigError, IdentificationError), match=r"decibels need units\.amplitude_unit"):
            import_file(tmp_path / "x.mat", mapping=tmp_path / "m.toml")


@pytest.mark.parametrize("even", [True, False])
def test_uneven_universal_files_are_read_if_their_instants_are_even(tmp_path, even):
    universal(tmp_path / "even.uff")
    file = pyuff.UFF(str(tmp_path / "even.uff"))
    for number in range(2):
        one = file.read_sets(number)
        x = np.arange(N) / 2000.0 if even else np.arange(N) ** 1.1 / 2000.0
        about = {**one, "x": x, "abscissa_spacing": 0, "binary": 0}
        pyuff.UFF(str(tmp_path / "x.uff")).write_sets([about], mode="add" if number else "overwrite")
    if even:
        found = time_data_in(datasets_in(tmp_path / "x.uff"))
        assert found.sample_rate_hz == 2000.0
        return
    with pytest.raises(RigError, match="its instants are not evenly spaced; resample it"):
        time_data_in(datasets_in(tmp_path / "x.uff"))
