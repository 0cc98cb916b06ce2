"""Tables as loggers write them: encodings, separators, quotes, lines above and below; the numbers are those of the print."""

import csv
import io
import sys
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification.mapping import CsvLayout
from rig.exchange.child_reading import ImportFailed
from rig.exchange.tables.guess import guessed_layout
from rig.exchange.tables.reading import read_table
from rig.exchange.tables.text import encoding_of
from rig.system.text_files import open_regular
from tests.refused import refused

CHANCE = np.random.default_rng(5)
VALUES = np.column_stack([np.arange(40) / 2048.0, CHANCE.normal(size=(40, 2))])
NAMES, UNITS = ("t", "Kraft", "Beschl"), ("s", "N", "m/s²")
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def written(
    path: Path,
    *,
    encoding: str = "utf-8",
    separator: str = ",",
    decimal: str = ".",
    newline: str = "\n",
    quoted: bool = False,
    ending: str = "",
    above: tuple[str, ...] = (),
    below: tuple[str, ...] = (),
    again: int = 0,
) -> Path:
    """Write the table as a logger does."""
    cells = [[f"{value!r}".replace(".", decimal) for value in row] for row in VALUES.tolist()]
    rows = [[*NAMES], [*UNITS], *cells]
    lines = [separator.join(f'"{cell}"' if quoted else cell for cell in row) + ending for row in rows]
    if again:
        lines[again:again] = lines[:2]
    path.write_bytes(newline.join([*above, *lines, *below, ""]).encode(encoding))
    return path


WRITTEN = {
    "Latin-1": {"encoding": "latin-1"},
    "UTF-8 with a mark": {"encoding": "utf-8-sig"},
    "UTF-16 with a mark": {"encoding": "utf-16", "separator": "\t"},
    "UTF-16 without a mark": {"encoding": "utf-16-le", "separator": ";", "decimal": ","},
    "UTF-16, large end first": {"encoding": "utf-16-be"},
    "lines that end with CR and LF": {"newline": "\r\n"},
    "lines that end with CR": {"newline": "\r"},
    "a separator at each end": {"ending": ","},
    "thousands of separators at each end": {"ending": "," * 3000},
    "decimal commas in quotes": {"decimal": ",", "quoted": True},
    "decimal commas": {"decimal": ",", "separator": ";"},
    "spaces behind separators": {"separator": ", "},
    "lines at the end": {"below": ("Max,1,2,3", "Mean,0.5,0.5,0.1")},
    "lines above": {"above": ("Logger 3", "Started,today"), "separator": ";", "decimal": ","},
    "a heading that is repeated": {"again": 20},
}


@pytest.mark.parametrize("how", WRITTEN)
def test_a_table_as_loggers_write_it_is_read_with_the_layout_that_is_found(tmp_path, how):
    path = written(tmp_path / "x.csv", **WRITTEN[how])
    found = read_table(path, guessed_layout(path))
    assert list(found.values) == [*NAMES]
    np.testing.assert_array_equal(np.column_stack([*found.values.values()]), VALUES)
    assert [found.unit(name) for name in NAMES] == [*UNITS]


@pytest.mark.parametrize("encoding", ["cp850", "cp437", "latin-1"])
def test_the_key_encoding_wins_over_what_is_found(tmp_path, encoding):
    path = written(tmp_path / "x.csv", encoding=encoding)
    assert encoding_of(path) == "cp1252"
    assert read_table(path, CsvLayout(encoding=encoding)).unit("Beschl") == "m/s²"


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(FINITE, FINITE), min_size=1, max_size=30), st.sampled_from([",;", ".,", ".;", ".\t"]))
def test_numbers_are_the_same_with_the_compiled_parser_and_without(tmp_path_factory, rows, how):
    decimal, separator = how[0], how[1]
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=separator)
    writer.writerows([["a", "b"], *([f"{value!r}".replace(".", decimal) for value in row] for row in rows)])
    path = tmp_path_factory.mktemp("numbers") / "x.csv"
    path.write_text(stream.getvalue())
    layout = CsvLayout(separator=separator, decimal=decimal)
    with pytest.MonkeyPatch.context() as patch:
        compiled = read_table(path, layout).values
        patch.setitem(sys.modules, "pandas", None)  # as without the package
        plain = read_table(path, layout).values
    for at, name in enumerate("ab"):
        np.testing.assert_array_equal(compiled[name], [row[at] for row in rows])
        np.testing.assert_array_equal(plain[name], compiled[name])


@pytest.mark.parametrize("pandas", [True, False], ids=["compiled", "plain"])
@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("1,2", "3,", "4,5"), {"says": "line-column-b-is-empty"}),
        (("1,2", "3,--", "4,5"), {"says": "line-column-b-is-no-number"}),
        (("1,2", "3,OVER", "4,5"), {"says": "line-column-b-over-is-no"}),
        (("1,2", "3", "4,5"), {"says": "line-values-for-names"}),
        (("1,2", "3,4,5", "4,5"), {"says": "line-values-for-names-2"}),
        (("1,2", "3,4", "Max,5", "Mean,4"), {"says": "line-column-a-max-is-no"}),
        (('1,"2,5"', '3,"4,5"'), {"says": "line-column-b-is-no-number-2"}),
    ],
)
def test_what_is_no_number_is_named_with_line_and_column(tmp_path, monkeypatch, pandas, lines, message):
    if not pandas:
        monkeypatch.setitem(sys.modules, "pandas", None)
    (tmp_path / "x.csv").write_text("\n".join(["a,b", *lines]) + "\n")
    with refused(ImportFailed, **message) as caught:
        read_table(tmp_path / "x.csv")
    assert "x.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_a_message_says_to_do_works(tmp_path):
    (tmp_path / "x.csv").write_text("a,b\n1,2\n3,4\nMax,5\n\nMean,4\n")
    found = read_table(tmp_path / "x.csv", CsvLayout(skip_last_lines=2))
    np.testing.assert_array_equal(found.values["b"], [2.0, 4.0])


def test_nan_as_a_text_stays_nan_for_the_mapping_to_refuse(tmp_path):
    (tmp_path / "x.csv").write_text("a,b\n1,2\n3,NaN\n")
    np.testing.assert_array_equal(read_table(tmp_path / "x.csv").values["b"], [2.0, np.nan])


def test_columns_of_texts_are_told_and_do_not_stand_in_the_way(tmp_path):
    (tmp_path / "x.csv").write_text("clock,a,b,state\n12:00:01,1,2,OK\n12:00:02,3,4,OK\n12:00:03,5,6,late\n")
    found = read_table(tmp_path / "x.csv", guessed_layout(tmp_path / "x.csv"))
    np.testing.assert_array_equal(found.values["b"], [2.0, 4.0, 6.0])
    np.testing.assert_array_equal(found.values["clock"], [43201.0, 43202.0, 43203.0])
    assert found.values["state"] == "<texts such as 'OK'>"


def test_blocks_do_not_show_in_the_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.exchange.tables.text._BLOCK", 100)
    path = written(tmp_path / "x.csv", below=("Max,1,2",), newline="\r\n")
    found = read_table(path, guessed_layout(path))
    np.testing.assert_array_equal(np.column_stack([*found.values.values()]), VALUES)


def test_noise_is_no_text(tmp_path):
    chance = Random(3)
    for _ in range(20):
        (tmp_path / "x.csv").write_bytes(chance.randbytes(3000))
        with refused(ImportFailed, "is-no-text-in"):
            encoding_of(tmp_path / "x.csv")
    with open_regular(tmp_path / "x.csv", 10_000) as stream:
        assert len(stream.read()) == 3000
