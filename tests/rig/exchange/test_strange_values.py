"""Strange values in files of others are one line that names the file."""

import json

import numpy as np
import pytest

from rig.errors import RigError
from rig.exchange.reading import import_file
from rig.exchange.sep005 import data_of_series
from tests.refused import refused

MAPPING = """kind = "time-data"
sample_rate_hz = 1000.0
channels = [
    { name = "force", role = "force", unit = "N", value = "F" },
    { name = "acc", role = "drive", unit = "m/s2", value = "a"%s },
]
"""
ROWS = "".join(f"{n},{2 * n}\n" for n in range(40))
LONG = "9" * 140_000
OURS = "# vibrolock: backbone\n# others: %s\nx\nm\n1\n"

TABLES = {
    "a long cell": f"F,a\n{ROWS}{LONG},1\n",
    "a long name": f"{LONG}x,a\n{ROWS}",
    "a long text in quotes": f'F,a\n{ROWS}"{LONG}\n{ROWS}"\n',
    "deep JSON": OURS % ("[" * 100_000),
    "JSON of another shape": OURS % "[1]",
    "JSON without a table": OURS % '{"table": 1, "arrays": [], "attributes": {}}',
    "a table with a wrong shape": OURS
    % '{"table": {"x": {"shape": [1e400], "axis": 0, "complex": false}}, "arrays": {}}',
    "a long cell of ours": OURS.replace("\n1\n", f"\n{LONG}\n") % '{"table": {}, "arrays": {}, "attributes": {}}',
}


@pytest.mark.parametrize("what", TABLES)
def test_a_strange_table_is_refused_in_one_line(tmp_path, what):
    (tmp_path / "x.csv").write_text(TABLES[what])
    (tmp_path / "m.toml").write_text(MAPPING % "")
    for mapping in (None, tmp_path / "m.toml"):
        with refused(RigError, "csv") as caught:
            import_file(tmp_path / "x.csv", mapping=mapping)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 500


@pytest.mark.parametrize("what", [name for name in TABLES if "ours" not in name and "JSON" not in name])
def test_of_a_strange_table_a_mapping_is_proposed_or_refused(tmp_path, command, what):
    (tmp_path / "x.csv").write_text(TABLES[what])
    done = command("new mapping x.csv -o m.toml")
    assert "unexpected" not in done.err
    assert "took more than" not in done.err
    assert done.err.count("\n") <= 1


@pytest.mark.parametrize(
    "time", [[1, 1], [2, 1], [1, np.nan], ["a", "b"], [[1, 2]], [None, 1], [0, 10**400], "ab", {}, 3]
)
def test_instants_that_do_not_increase_evenly_are_refused(time):
    with refused(RigError, "series-time-allowed-are-evenly-spaced"):
        data_of_series([{"data": [1.0, 2.0], "name": "F", "unit_str": "N", "time": time}])


@pytest.mark.parametrize("key", ["data", "name", "unit_str", "fs"])
@pytest.mark.parametrize(
    "value", [None, "a", [], {}, [[1, 2]], 10**400, -1, 0, True, [1, 10**400], [1, "a"], float("nan")]
)
def test_a_strange_value_in_a_series_is_refused_by_its_key(key, value):
    one = {"data": [1.0, 2.0], "name": "F", "unit_str": "N", "fs": 100.0, key: value}
    if isinstance(value, str) and key in ("name", "unit_str"):
        assert data_of_series([one]).sample_rate_hz == 100.0
        return
    with pytest.raises(RigError) as caught:
        data_of_series([one])
    assert f"series[0].{key}" in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    "name", ["../x.csv", "/etc/hostname", "sub/x.csv", "..", ".", r"..\x.csv", r"C:\x.csv", "C:x.csv"]
)
def test_a_mapping_reads_no_file_outside_its_folder(tmp_path, name):
    folder = tmp_path / "given"
    (folder / "sub").mkdir(parents=True)
    for path in (tmp_path / "x.csv", folder / "x.csv", folder / "sub" / "x.csv"):
        path.write_text(f"F,a\n{ROWS}")
    (folder / "m.toml").write_text(MAPPING % f", file = {json.dumps(name)}")
    with refused(RigError, "allowed-is-the-name-of-file"):
        import_file(folder / "x.csv", mapping=folder / "m.toml")
