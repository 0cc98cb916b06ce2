"""The site builds without a warning and without a network; every link in it leads somewhere, and every word has its place."""

import importlib.util
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from typer.main import get_command

from rig.cli.app import app
from rig.reference.words import known_words, read_words
from tests.docs.pages import ROOT
from tests.sharing import made_once, shared_folder

DOCS = ROOT / "docs"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("sphinx") is None, reason="Sphinx is not installed ('vibrolock[docs]')"
    ),
]


class Page(HTMLParser):
    """What a page links to, what it loads, and the places on it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.loads: set[str] = set()
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        """Note a tag."""
        given = dict(attrs)
        self.places |= {given[name] for name in ("id", "name") if given.get(name)}
        if tag == "a" and given.get("href"):
            self.links.add(given["href"])
        elif tag == "link" and given.get("rel") not in ("canonical", "license"):
            self.loads.add(given.get("href") or "")
        elif tag in ("script", "img", "source", "iframe") and given.get("src"):
            self.loads.add(given["src"])


def build(folder):
    """Build the site without running the gallery, and keep the warnings beside it."""
    gallery = ["-D", "plot_gallery=0"] if "sphinx_gallery" in (DOCS / "conf.py").read_text() else []
    command = [sys.executable, "-m", "sphinx", "-q", "-E", "-b", "html", *gallery, "-d", str(folder / "doctrees")]
    command += ["-w", str(folder / "warnings.txt"), str(DOCS), str(folder / "site")]
    out = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stderr


@pytest.fixture(scope="module")
def built():
    """Folder of the site, and the warnings of its build: one for all workers, since a gallery is written beside its sources."""
    folder = made_once(shared_folder() / "site", build)
    return folder / "site", (folder / "warnings.txt").read_text(encoding="utf-8").splitlines()


@pytest.fixture(scope="module")
def pages(built):
    """Every page of the site by its address."""
    found = [path for path in sorted(built[0].rglob("*.html")) if "_static" not in path.parts]
    return {path.relative_to(built[0]).as_posix(): Page(path) for path in found}


def test_no_page_causes_a_warning(built):
    assert built[1] == []


def inside(links):
    return {link for link in links if not re.match(r"(\w+:|//)", link)}


def test_every_link_inside_the_site_leads_to_a_page_and_to_a_place_on_it(built, pages):
    dead = set()
    for name, page in pages.items():
        for link in inside(page.links):
            target, _, place = link.partition("#")
            path = (built[0] / name).parent / unquote(target) if target else built[0] / name
            other = pages.get(path.resolve().relative_to(built[0].resolve()).as_posix())
            if not path.exists() or (place and other and unquote(place) not in other.places):
                dead.add(f"{name}: {link}")
    assert dead == set()


def test_nothing_is_loaded_from_elsewhere(pages):
    assert pages["index.html"].loads
    assert {load for page in pages.values() for load in page.loads - inside(page.loads)} == set()


def test_formulas_are_typeset_when_the_site_is_built(built):
    page = (built[0] / "explanation" / "damping.html").read_text(encoding="utf-8")
    formulas = re.findall(r"<math.*?</math>", page, re.DOTALL)
    sources = re.findall(r"\$+[^$]+\$+", (DOCS / "explanation" / "damping.md").read_text(encoding="utf-8"))
    assert len(formulas) == len(sources) > 0
    assert "ζ" in formulas[2]
    assert re.search(r"<mfrac[^>]*>\s*<mn>1</mn>\s*<mn>2</mn>\s*</mfrac>", page), "one half is not a half"
    assert not re.search(r"\\\w|\$", re.sub(r"<[^>]*>", "", page.split("<article")[1].split("</article")[0]))


def test_every_word_of_the_code_has_its_place_on_the_site(built, pages):
    words = read_words(built[0])
    messages = (DOCS / "reference" / "messages").is_dir()
    for word, hits in known_words(get_command(app)).items():
        there = {hit.title: hit for hit in words[word]}
        for hit in hits:
            if hit.what == "message" and not messages:
                continue
            page, _, place = there[hit.title].url.partition("#")
            assert page in pages, f"{hit.title} has no page"
            assert not place or place in pages[page].places, there[hit.title].url


def test_every_page_is_found_by_its_title(built, pages):
    known = {hit.url.partition("#")[0] for hits in read_words(built[0]).values() for hit in hits}
    assert set(pages) - known == {"genindex.html", "search.html", "py-modindex.html"} & set(pages)


def search_index(built):
    text = (built[0] / "searchindex.js").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("Search.setIndex(").rstrip(")"))


GUIDES = {
    "cite": "cite",
    "duration": "how-to/how-long-will-my-test-take",
    "ni": "how-to/use-ni-daqmx",
    "which model": "how-to/which-model",
    "settle": "how-to/set-the-ramp-and-settling",
    "random": "reference/what-this-version-does-not-do",
    "vibrometer": "how-to/sensors",
    "amplifier": "how-to/describe-a-bench",
    "laptop": "how-to/set-up-a-machine",
    "two modes": "how-to/tune-a-rig",
    "matlab": "how-to/export-to-other-programs",
}


@pytest.mark.parametrize("word", GUIDES)
def test_a_word_that_people_search_for_leads_to_the_page_that_answers(built, word):
    index = search_index(built)
    assert GUIDES[word] in {index["docnames"][number] for number, _, main in index["indexentries"][word] if main}
    assert "var Scorer" in (built[0] / "_static" / "language_data.js").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("word", "page"), [("settl", "reference/keys/settle"), ("multisin", "reference/keys/multisine")]
)
def test_the_search_finds_a_word(built, word, page):
    index = search_index(built)
    found = index["terms"].get(word, []), index["titleterms"].get(word, [])
    numbers = {number for one in found for number in (one if isinstance(one, list) else [one])}
    assert page in {index["docnames"][number] for number in numbers}
    assert any(name.startswith("settle") for name in index["objects"])
