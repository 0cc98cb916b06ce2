"""Time data in files of other programs: samples, units and rates come back, and so do proposed mappings."""

import numpy as np
import pytest
from sdypy_sep005.sep005 import assert_sep005

from identification import TimeRecords
from rig.exchange.child_reading import ImportFailed
from rig.exchange.proposal.proposal import proposed_mapping
from rig.exchange.reading import import_file, import_sep005
from tests.refused import refused
from tests.rig.exchange.time_data.files import ACCELERATION, FILES, FORCE, FULL_SCALE, RATE_HZ, series

IN_SI = ("universal.uff", "series.json")
"""Files whose values are in SI once they are read."""
EXTRA = {
    "v5.mat": 'time = "t"',
    "v73.mat": f"sample_rate_hz = {RATE_HZ}",
    "v4.mat": f"sample_rate_hz = {RATE_HZ}",
    "table.csv": 'time = "time"',
    "comma.txt": f"""sample_rate_hz = {RATE_HZ}
csv = {{ skip_lines = 2, names = ["column1", "column2"], separator = "\\t", decimal = "," }}""",
    "lab.h5": f"sample_rate_hz = {RATE_HZ}",
    "archive.npz": f"sample_rate_hz = {RATE_HZ}",
    "book.xlsx": 'time = "time"',
    "classic.nc": f"sample_rate_hz = {RATE_HZ}",
    "timetable.mat": f"sample_rate_hz = {RATE_HZ}",
}


def told(name: str) -> str:
    """Return a mapping of one of the files."""
    _, force, acceleration = FILES[name]
    unit, scale = ("m/s2", "") if name in IN_SI else ("g", "")
    if name in ("comma.txt", "sound.wav"):
        unit, scale = "m/s2", f"scale = {FULL_SCALE if name == 'sound.wav' else 1.0}"
    more = 'axes = ["sample", "channel"]' if name == "v73.mat" else ""
    return f"""
kind = "time-data"
specimen = "beam"
{EXTRA.get(name, "")}
[[channels]]
name = "force"
role = "force"
unit = "N"
value = "{force}"
{scale}
[[channels]]
name = "acceleration"
role = "drive"
unit = "{unit}"
value = "{acceleration}"
{scale}
{more}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("files")
    for name, (write, _, _) in FILES.items():
        write(found / name)
    return found


def same(found: TimeRecords, name: str) -> None:
    # UFF in ASCII has six digits less than a double, WAV here 24 bits of full scale.
    tolerance = {"universal.uff": 1e-10, "sound.wav": FULL_SCALE / 2**23}.get(name, 1e-9)
    np.testing.assert_allclose(found.records[0].samples, [FORCE, ACCELERATION], rtol=1e-9, atol=tolerance)
    assert found.sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-9)
    assert [channel.unit for channel in found.channels] == ["N", "m/s2"]


@pytest.mark.parametrize("name", FILES)
def test_samples_units_and_rate_are_those_that_the_other_program_wrote(folder, tmp_path, name):
    (tmp_path / "m.toml").write_text(told(name))
    found = import_file(folder / name, mapping=tmp_path / "m.toml")
    assert isinstance(found, TimeRecords)
    assert (found.specimen, len(found.records), found.period_samples) == ("beam", 1, 0)
    same(found, name)


def test_series_of_sep005_in_memory_are_read_as_those_in_a_file(tmp_path):
    assert_sep005(series())
    (tmp_path / "m.toml").write_text(told("series.json"))
    same(import_sep005(series(), tmp_path / "m.toml"), "series.json")


@pytest.mark.parametrize("name", FILES)
def test_a_proposed_mapping_is_accepted_as_it_is(folder, tmp_path, name):
    text, missing = proposed_mapping([folder / name])
    assert missing == (("sample_rate_hz",) if name == "comma.txt" else ())
    text = text.replace("#sample_rate_hz =", f"sample_rate_hz = {RATE_HZ}\n#") if missing else text
    (tmp_path / "m.toml").write_text(text)
    found = import_file(folder / name, mapping=tmp_path / "m.toml")
    assert [channel.role for channel in found.channels][:2] == ["force", "drive"]
    assert found.sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-9)
    if name in ("table.csv", "universal.uff", "labview.tdms", "car.mf4", "series.json"):
        same(found, name)  # the file tells every unit


def test_a_unit_that_contradicts_the_file_is_refused(folder, tmp_path):
    (tmp_path / "m.toml").write_text(told("labview.tdms").replace('unit = "g"', 'unit = "m/s2"'))
    with refused(ImportFailed, "the-file-own-units-make-it-2", field="channels.acceleration.unit", value="m/s2"):
        import_file(folder / "labview.tdms", mapping=tmp_path / "m.toml")


def test_input_and_output_in_two_files_become_one_record(folder, tmp_path):
    for name in ("sound.wav", "table.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    text = told("sound.wav").replace('value = "channel2"', 'value = "a"\nfile = "table.csv"').replace('"m/s2"', '"g"')
    text = text[: text.rindex("scale")]  # of the acceleration, which is in g in the table
    (tmp_path / "m.toml").write_text(text)
    found = import_file(tmp_path / "sound.wav", mapping=tmp_path / "m.toml")
    same(found, "sound.wav")
    proposed, missing = proposed_mapping([tmp_path / "sound.wav", tmp_path / "table.csv"])
    assert not missing
    assert 'file = "table.csv"' in proposed
