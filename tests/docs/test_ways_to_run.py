"""The page of ways to run is what its rows say, and all rows can be read."""

from studies.matrix.rows import read_rows
from studies.matrix.transports import transports
from tests.docs.ways_to_run import ROWS, made, parts


def test_the_page_is_made_from_the_rows():
    assert parts()[1] == made(), "python -m tests.docs.ways_to_run --write makes it anew"


def test_every_way_that_is_measured_has_a_row_that_was_measured_and_verified():
    rows = {row.way: row for row in read_rows(ROWS)}
    for way in transports():
        assert rows[way.name].reached_hz, way.name
        assert rows[way.name].verified, way.name
