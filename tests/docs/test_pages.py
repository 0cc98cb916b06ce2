"""Whoever follows a page of the documentation gets what it says: its commands, its examples, its output."""

import re
import sys
from pathlib import Path

import pytest
from joblib.externals.loky import get_reusable_executor

import rig
from rig.campaigns.kinds import KINDS
from tests.docs.output import assert_shows
from tests.docs.pages import ROOT, blocks, pages
from tests.docs.reader import Reader

QUICK = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8]
record_periods = 8

[controller]
low_pass_rad_s = 6.283
k1 = 2.0
k2 = 6.283
centre_frequency_hz = 24.0
frequency_window_hz = [22.0, 27.0]
"""
NEEDS = {"docs/file-format.md": "OUT.h5"}  # pages that speak of a recording without making one
LIBRARIES = {  # optional ones that a page uses
    "docs/editors-and-tables.md": ("pandas", "xarray"),
    "docs/how-to/pyema.md": ("sdypy.EMA",),
}
NOT_RUN = {
    ("docs/editors-and-tables.md", "Taplo and Tombi are other programs; tests/rig/authoring runs both"),
    (
        "docs/how-to/other-programs.md",
        "fetches all dependencies, some 500 MB; tests/test_distribution.py runs it where uv is installed",
    ),
    ("docs/how-to/sdynpy.md", "SDynPy brings Qt and VTK; run by hand with SDynPy 0.23.0"),
    ("README.md", "needs the device"),
    ("docs/emulator.md", "runs until Ctrl-C"),
    ("docs/hardware-in-the-loop.md", "takes half a minute each; tests/hardware runs the same"),
    ("docs/monitor.md", "runs until Ctrl-C"),
    ("docs/monitor.md", "takes a minute by the clock and needs Chromium"),
    ("docs/user-guide.md", "a minute of wall clock"),
    ("docs/wire-protocol-can.md", "needs a CAN interface"),
    ("docs/writing-a-driver.md", "installs a package"),
    ("docs/benchmarks.md", "takes minutes"),
}


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def anchors(page: Path) -> set[str]:
    """What links may end in: headings in small letters, hyphens for spaces, without any other sign."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.fixture(autouse=True)
def nothing_of_a_page_stays(tmp_path):
    """Neither its modules nor worker processes, which would keep its folder and import path."""
    get_reusable_executor().shutdown()
    before = set(sys.modules)
    yield
    get_reusable_executor().shutdown()
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_a_page_does_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    for library in LIBRARIES.get(name_of(page), ()):
        pytest.importorskip(library, reason=f"{library} is not installed (pip install 'vibrolock[dev]')")
    if name_of(page) in NEEDS:
        Path("quick.toml").write_text(QUICK)
        rig.run("quick.toml", output=NEEDS[name_of(page)]).close()
    Reader(page).follow()


PRINTED = "one 1.00\ntwo 2.00 words\nthree"


@pytest.mark.parametrize("shown", ["one 1.01\ntwo … words", "…\nthree", "two 2.00 …", "one …\n…\nthree", PRINTED])
def test_output_that_is_shown_and_printed_passes(shown):
    assert_shows(shown, PRINTED, "here")


@pytest.mark.parametrize("shown", ["one 1.05", "one 1.00\nthree", "two words …", "three\none 1.00", "four", "two 2.00"])
def test_output_that_is_shown_and_not_printed_fails(shown):
    with pytest.raises(AssertionError, match="is not what was printed"):
        assert_shows(shown, PRINTED, "here")


def test_what_is_not_run_is_listed_here_with_its_reason():
    assert {(name_of(page), block.not_run) for page in pages() for block in blocks(page) if block.not_run} == NOT_RUN


def test_every_link_between_pages_leads_to_a_file_and_to_a_heading_in_it():
    for page in [*pages(), ROOT / "CHANGELOG.md"]:
        for target, anchor in re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8")):
            if "://" in target:
                continue
            linked = page.parent / target if target else page
            assert linked.exists(), f"{name_of(page)}: {target}"
            assert not anchor or anchor in anchors(linked), f"{name_of(page)}: {target}#{anchor}"


def test_every_kind_of_plan_is_in_the_table_of_kinds():
    table = (ROOT / "docs" / "user-guide.md").read_text(encoding="utf-8").split("\n## Plans\n")[1].split("\n\n")[1]
    assert set(re.findall(r"^\| \[?`([\w-]+)`", table, re.MULTILINE)) == set(KINDS)


def test_decisions_are_numbered_without_gaps_and_say_context_decision_consequences():
    records = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
    assert [path.name[:5] for path in records] == [f"{number:04d}-" for number in range(1, len(records) + 1)]
    for path in records:
        text = path.read_text(encoding="utf-8")
        assert text.startswith(f"# {path.name[:4]}. ")
        assert [line for line in text.splitlines() if line.startswith("## ")] == [
            "## Context",
            "## Decision",
            "## Consequences",
        ], path.name
    index = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^- \[(\d{4})\]\(([^)]+)\)", index, re.MULTILINE)) == [
        (path.name[:4], path.name) for path in records
    ]
