"""What is printed becomes paragraphs, facts and tables of a page."""

import pytest

from rig.report.document import Facts, Table, Text, blocks_of, typeset
from rig.show.loop_table import print_loop
from rig.text.console import PrintedTable, collected, print_table


def test_lines_and_tables_are_collected_apart_and_in_their_order(capsys):
    with collected() as printed:
        print("one")
        print_table(("a", "b"), [("1", "2")])
        print("two\n\nthree")
    assert printed == ["one", PrintedTable(("a", "b"), (("1", "2"),)), "two", "three"]
    assert capsys.readouterr().out == ""


def test_a_line_before_a_table_is_its_caption_and_named_values_are_facts():
    table = PrintedTable(("a",), (("1",),))
    lines = ["known from      a check", "                and a tuning", "in words", table, "note: mind", table]
    found = blocks_of(lines, "Values")
    assert found[0] == Facts("", [("known from", "a check"), ("", "and a tuning")])
    assert found[1] == Table("in words", ("a",), (("1",),))
    assert found[2] == Text("note: mind", "note")
    assert found[3].caption == "Values"


def test_the_timing_of_a_loop_by_the_clock_is_two_lines_and_a_table():
    times = {"p50": 20.0, "p99": 50.0, "p99_9": 90.0, "largest": 300.0}
    loop = {"real_time": {"pacing": "host", "memory": "locked"}, "overruns": 3, "deadline_us": 200.0}
    loop |= {"wake_up_us": times, "histograms": {"execution": {"count": [5, 6]}}}
    with collected() as printed:
        print_loop(loop, {"lost_samples": 7})
    pace, table, overruns = blocks_of(printed, "Times")
    assert pace == Text("paced by the host; memory locked")
    assert table.rows == (("  wake-up", "20.0", "50.0", "90.0", "300.0"),)
    assert overruns == Text("3 overruns in 11 blocks (response beyond 200 us, or left out), 7 lost samples")


@pytest.mark.parametrize(
    ("text", "set_as"),
    [("12 m/s^2", "12 m/s²"), ("+-", "±"), (">= 3", "≥ 3"), ("a\x1b[31m\u202e", "a\\x1b[31m\\u202e"), (None, "None")],
)
def test_text_is_set_with_the_signs_of_a_page_and_is_printable(text, set_as):
    assert typeset(text) == set_as
