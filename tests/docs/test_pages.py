"""Whoever follows a page of the documentation gets what it says: its commands, its examples, its output."""

import re
from pathlib import Path
from typing import Any

import pytest

from rig.campaigns.kinds import KINDS
from rig.reference.keys import keys_of
from tests.docs.output import assert_shows
from tests.docs.pages import ROOT, blocks, pages
from tests.docs.taken import followed
from tests.recorded import SHORT, recorded
from tests.refused import refused

NEEDS = {  # pages that speak of a recording without making one
    "docs/how-to/replay-a-recording.md": "backbone.h5",
    "docs/reference/file-format.md": "OUT.h5",
}
LIBRARIES = {  # optional ones that a page uses
    "docs/how-to/use-pandas-and-xarray.md": ("pandas", "xarray"),
    "docs/how-to/pyema.md": ("sdypy.EMA",),
}
NOT_RUN = {
    ("docs/how-to/complete-files-in-an-editor.md", "Taplo and Tombi are other programs; tests/rig/authoring runs both"),
    (
        "README.md",
        "fetches all dependencies, some 500 MB; tests/test_distribution.py runs it where uv is installed",
    ),
    ("docs/how-to/sdynpy.md", "SDynPy brings Qt and VTK; run by hand with SDynPy 0.23.0"),
    ("README.md", "needs the device"),
    ("docs/how-to/replay-a-recording.md", "runs until Ctrl-C"),
    ("docs/how-to/measure-a-decay.md", "a recording of one's own"),
    ("docs/how-to/reproduce-a-reference-study.md", "needs data that are not part of this project"),
    ("docs/how-to/choose-block-queue-and-watchdog.md", "needs the device"),
    ("docs/how-to/use-a-sound-card.md", "needs the device"),
    ("docs/how-to/use-a-sound-card.md", "needs the emulated card"),
    ("docs/how-to/use-a-sound-card.md", "installs a package"),
    ("docs/how-to/use-a-sound-card.md", "runs until Ctrl-C"),
    ("docs/how-to/use-ni-daqmx.md", "needs the device"),
    ("docs/how-to/use-ni-daqmx.md", "needs the emulated chassis"),
    ("docs/how-to/use-ni-daqmx.md", "installs a package"),
    ("docs/how-to/use-ni-daqmx.md", "runs until Ctrl-C"),
    ("docs/how-to/compare-ways-to-run.md", "needs the device"),
    ("docs/how-to/compare-ways-to-run.md", "installs a distribution"),
    ("docs/how-to/reproduce-the-paper.md", "installs a distribution"),
    ("docs/how-to/compare-ways-to-run.md", "takes a minute by the clock"),
    ("docs/how-to/swap-in-a-driver.md", "needs the device"),
    ("docs/how-to/build-a-device.md", "needs the device"),
    ("docs/how-to/first-hour-with-a-nucleo.md", "needs the board"),
    ("docs/how-to/first-hour-with-a-nucleo.md", "needs a compiler for ARM"),
    ("docs/how-to/try-the-firmware.md", "needs a compiler for ARM"),
    (
        "docs/how-to/write-a-board.md",
        "take a quarter of an hour to an hour; tests/firmware/test_checks.py and test_differential.py run shorter forms",
    ),
    ("docs/how-to/from-a-first-cable-to-a-first-backbone.md", "needs the device"),
    ("docs/how-to/write-a-board.md", "a test compiles the board above with these options"),
    ("docs/how-to/test-my-bench-with-pytest.md", "takes half a minute each; tests/hardware runs the same"),
    ("docs/how-to/try-the-firmware.md", "runs until Ctrl-C"),
    ("docs/how-to/try-without-hardware.md", "runs until Ctrl-C"),
    ("docs/how-to/watch-a-run-in-a-terminal.md", "runs until Ctrl-C"),
    ("docs/how-to/watch-a-run.md", "runs until Ctrl-C"),
    ("docs/how-to/watch-from-another-machine.md", "runs until Ctrl-C"),
    ("docs/reference/run-page.md", "takes a minute by the clock and needs Chromium"),
    ("docs/tutorials/a-driver.md", "installs a package"),
    ("docs/how-to/reproduce-the-paper.md", "takes some minutes"),
    ("docs/reference/wire-protocol-can.md", "needs a CAN interface"),
    ("docs/reference/benchmarks.md", "takes minutes"),
    ("docs/reference/race-of-methods.md", "takes an hour"),
    ("docs/reference/compiled-tick.md", "takes minutes and needs a compiler for ARM and QEMU"),
    ("docs/reference/firmware-sizes.md", "takes minutes and needs a compiler for ARM and QEMU"),
}


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def anchors(page: Path) -> set[str]:
    """What links may end in: headings in small letters, hyphens for spaces, without any other sign; keys of a table."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    tables = [block.language.split()[1] for block in blocks(page) if block.language.startswith("{keys} ")]
    keys = {key.anchor for table in tables for key in keys_of(table)}
    return keys | {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


SLOW = (
    "README.md",
    "docs/explanation/structured-models.md",
    "docs/tutorials/a-driver.md",
    *(
        f"docs/how-to/{name}.md"
        for name in (
            "check-a-rig",
            "choose-block-queue-and-watchdog",
            "combine-several-backbones",
            "cut-a-force-surface",
            "figures",
            "find-out-why-samples-were-lost",
            "fit-runs-that-differ",
            "identify-a-pnlss-model",
            "identify-a-structured-model",
            "identify-many-models",
            "improve-a-plan",
            "make-the-force-a-sine",
            "measure-a-backbone-quickly",
            "measure-a-decay",
            "measure-at-constant-response",
            "measure-frequency-responses",
            "measure-with-a-hammer",
            "measure-with-a-multisine",
            "predict-a-frequency-response",
            "predict-a-sweep",
            "predict-with-a-pnlss-model",
            "protect-a-fragile-specimen",
            "put-the-loop-on-a-board",
            "pyema",
            "rehearse-a-plan",
            "reproduce-the-paper",
            "resume-an-interrupted-run",
            "run-a-parameter-study",
            "run-a-test-and-read-it",
            "tune-a-rig",
            "use-my-own-time-data",
            "use-the-controller-in-my-own-loop",
            "which-model",
            "write-a-report",
        )
    ),
)


def marked(page: Path) -> Any:
    return pytest.param(page, id=name_of(page), marks=[pytest.mark.slow] if name_of(page) in SLOW else [])


@pytest.mark.parametrize("page", [marked(page) for page in pages()])
def test_a_page_does_what_it_says(page):
    name = name_of(page)
    for library in LIBRARIES.get(name, ()):
        pytest.importorskip(library, reason=f"{library} is not installed (pip install 'vibrolock[dev]')")
    followed(name, {NEEDS[name]: recorded("magnet-beam/backbone", **SHORT)} if name in NEEDS else {})


PRINTED = "one 1.00\ntwo 2.00 words\nthree"


@pytest.mark.parametrize("shown", ["one 1.01\ntwo … words", "…\nthree", "two 2.00 …", "one …\n…\nthree", PRINTED])
def test_output_that_is_shown_and_printed_passes(shown):
    assert_shows(shown, PRINTED, "here")


@pytest.mark.parametrize("shown", ["one 1.05", "one 1.00\nthree", "two words …", "three\none 1.00", "four", "two 2.00"])
def test_output_that_is_shown_and_not_printed_fails(shown):
    with refused(AssertionError, "is-not-what-was-printed"):
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
    page = (ROOT / "docs" / "how-to" / "which-kind-of-test.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| \[`([\w-]+)`", page, re.MULTILINE)) == set(KINDS)


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


@pytest.mark.parametrize("section", ["tutorials", "how-to", "explanation", "reference"])
def test_every_page_of_a_section_is_in_its_index(section):
    folder = ROOT / "docs" / section
    lists = re.findall(r"^```\{toctree\}\n(.*?)^```", (folder / "index.md").read_text(encoding="utf-8"), re.M | re.S)
    listed = [line for one in lists for line in one.splitlines() if line and not line.startswith(":")]
    below = {f"{index.parent.name}/index" for index in folder.glob("*/index.md")}
    assert sorted(listed) == sorted({page.stem for page in folder.glob("*.md")} - {"index"} | below)


LONGEST = {"tutorials": 1500, "how-to": 2500, "explanation": 2500}  # words


@pytest.mark.parametrize("section", LONGEST)
def test_pages_are_short(section):
    for page in (ROOT / "docs" / section).glob("*.md"):
        assert len(page.read_text(encoding="utf-8").split()) <= LONGEST[section], name_of(page)
