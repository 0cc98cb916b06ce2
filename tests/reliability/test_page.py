"""The page of the campaign has a place for every part, and what is written there is what the parts print."""

import pytest

from tests.docs.pages import ROOT
from tests.reliability.__main__ import LONG, carried_out, marks, tables_in
from tests.reliability.pages import between


def test_the_page_has_a_place_for_every_part():
    text = (ROOT / "docs" / "reference" / "reliability.md").read_text(encoding="utf-8")
    for part in LONG:
        begin, end = marks(part)
        assert text.index(begin) < text.index(end)


def test_a_table_takes_the_place_of_the_one_before_and_prose_stays():
    begin, end = marks("kills")
    page = f"prose\n\n{begin}\n\nold\n\n{end}\n\nmore\n"
    once = between(page, begin, end, "| a |\n|---|\n")
    assert once == f"prose\n\n{begin}\n\n| a |\n|---|\n\n{end}\n\nmore\n"
    assert between(once, begin, end, "old") == page


def test_only_the_tables_of_what_is_printed_are_kept():
    assert tables_in("a line\n| a |\n|---|\n\nsaid\n| b |\n") == "| a |\n|---|\n\n| b |"


@pytest.mark.slow
def test_a_part_is_carried_out_by_its_command():
    said = []
    status, output = carried_out("mutations", ("--files", "4"), said.append)
    assert status == 0
    assert tables_in(output).startswith("| files |")
    assert said[0].startswith("mutations: status 0")
