"""The page on accuracy names places that exist; the page on citing has the version and the paper of CITATION.cff."""

import re

import vibrolock
from tests.docs.pages import ROOT, table_under

PAGE = (ROOT / "docs" / "reference" / "how-accurate-is-it.md").read_text(encoding="utf-8")


def rows():
    table = table_under("How accurate is it, and who says so?", PAGE)["table"]
    return [[cell.strip() for cell in line.strip("|\n ").split(" | ")] for line in table.splitlines()[2:]]


def test_every_comparison_names_its_truth_its_difference_and_a_place_that_exists():
    compared = [row for row in rows() if not row[0].startswith("**")]
    assert len(compared) > 20
    for what, truth, difference, where in compared:
        assert truth, what
        assert difference, what
        assert "`" in where or "](" in where or where.startswith("the same"), what
        for path in re.findall(r"`(tests/[^`]+)`", where):
            assert (ROOT / path).exists(), path


def test_the_page_on_citing_says_what_the_citation_file_says():
    page = (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version = {{{vibrolock.__version__}}}" in page
    for key, field in (("volume", "volume"), ("year", "year"), ("start", "pages")):
        found = re.search(rf"^    {key}: (\d+)$", citation, re.MULTILINE)
        assert found
        assert re.search(rf"{field}\s+= \{{{found.group(1)}\}}", page), key
    for name in re.findall(r"family-names: (\w+)", citation):
        assert name.replace("ë", '{\\"e}') in page
