"""Rows of the matrix: in files and as a table, whoever has measured them."""

import re

import pytest
from hypothesis import given, strategies as st

from rig.errors import ConfigurationError
from studies.matrix.rows import Row, Verified, read_rows, write_rows
from studies.matrix.table import print_matrix
from tests.refused import refused

OURS = {
    "bench": "magnet-beam",
    "driver": "serial",
    "utc": "2026-11-23T12:00:00+00:00",
    "version": "0.1.0",
}
THEIRS = {
    "bench": "their-beam",
    "driver": "can",
    "utc": "2027-02-01T09:30:00+00:00",
    "version": "0.2.0",
}
SUITE = Verified(utc="2026-11-24T12:00:00+00:00", passed=25, failed=1, not_applicable=5, failures=("stop: 0.05 V",))


def row(way="serial, emulator", **changes):
    return Row(**{**OURS, "machine": "Linux, 2 x here", "way": way, **changes})


positive = st.floats(1e-6, 1e6)


@pytest.mark.parametrize("suffix", [".toml", ".json"])
@given(
    made=st.builds(
        Row,
        way=st.text("ab äµ\"'\\,[]", min_size=1, max_size=12),
        bench=st.just("b"),
        driver=st.just("d"),
        utc=st.just("2026-11-23"),
        version=st.just("0.1.0"),
        machine=st.just("m"),
        sample_rate_hz=st.none() | positive,
        latency_ms=st.none() | positive,
        block=st.none() | st.integers(0, 10**6),
        held_blocks=st.none() | st.just(0),
        resolution_mv=st.dictionaries(st.sampled_from(["force", "tip.1"]), positive, max_size=2),
        to_0v=st.sampled_from([None, "measured", "reported"]),
        verified=st.none() | st.just(SUITE),
    )
)
def test_rows_are_read_as_they_were_written(tmp_path_factory, suffix, made):
    path = tmp_path_factory.getbasetemp() / f"rows{suffix}"
    write_rows(path, [made, row()])
    assert read_rows(path) == [made, row()]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("no table", {"says": "cannot-be-read"}),
        ('[[row]]\nway = "x"', {"says": "bench", "field": "row[0].bench"}),
        ('[[rows]]\nway = "x"', {"field": "row"}),
        ("row = 3", {"field": "row", "value": 3}),
    ],
)
def test_a_file_that_is_none_is_refused_in_one_line(tmp_path, text, named):
    (tmp_path / "theirs.toml").write_text(text)
    with refused(ConfigurationError, **named) as caught:
        read_rows(tmp_path / "theirs.toml")
    assert "theirs.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_table_keeps_where_when_and_with_what_each_row_was_measured(capsys):
    rows = [
        row(sample_rate_hz=5000.0, held_blocks=3, blocks=750, resolution_mv={"a": 0.3, "b": 0.6}, verified=SUITE),
        row("a real board", **THEIRS, machine="Linux, 8 x there", watchdog_s=0.1, to_0v="reported"),
        row("virtual", to_0v="ends with its process"),
        row("firmware", failure="DaqTimeout: nothing answers"),
    ]
    print_matrix(rows)
    lines = capsys.readouterr().out.splitlines()
    ours, theirs, virtual = lines[1:4]
    assert re.search(r"serial, emulator +5000 .* 3 of 750 .* 0.6 .* 25/1/5 +\[1\]$", ours)
    assert re.search(r"0\.1 \(r\) +not run +\[2\]$", theirs)
    assert re.search(r"at once +not run +\[3\]$", virtual)
    assert "[2] Linux, 8 x there; vibrolock 0.2.0; bench their-beam; 2027-02-01" in lines
    assert "serial, emulator: stop: 0.05 V" in lines
    assert "firmware: DaqTimeout: nothing answers" in lines
    assert len({len(line.rpartition("[")[0]) for line in lines[1:5]}) == 1
