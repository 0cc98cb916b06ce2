"""A report as a browser reads it: checked for form, and taken apart into its tables."""

import re
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

VOID = {"meta", "img", "br", "link", "hr", "input"}
CELLS = {"td", "th", "dt", "dd"}
OUTSIDE = {"src", "href", "xlink:href", "data", "action", "poster", "srcset", "formaction"}


class Page(HTMLParser):
    """Reads a page; fails where a tag is not closed in its order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.events: list[str] = []
        self.headings: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        self.seen.add(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in OUTSIDE:
                self.links.append(value or "")
            if name.startswith("on"):
                self.events.append(name)
        if tag in ("table", "dl"):
            self.tables.append([])
        elif tag == "tr" or (tag == "div" and self.open[-2] == "dl"):
            self.tables[-1].append([])
        elif tag in CELLS:
            self.tables[-1][-1].append("")
        elif re.fullmatch("h[1-6]", tag):
            self.headings.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without its beginning"
        assert self.open.pop() == tag, f"</{tag}> in the wrong order"

    def handle_data(self, data):
        if "style" not in self.open:
            self.words.append(data)
        if self.open and CELLS & set(self.open) and self.tables:
            self.tables[-1][-1][-1] += data

    @property
    def text(self) -> str:
        """The text of the page."""
        return " ".join(" ".join(self.words).split())

    def rows(self) -> list[list[str]]:
        """The rows of all tables."""
        return [[" ".join(cell.split()) for cell in row] for table in self.tables for row in table]


def read(path: Path) -> Page:
    """Read a report, and check what holds for each: well formed, nothing from outside, nothing that runs, headings in order."""
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert not page.seen & {"script", "iframe", "object", "embed", "link", "base", "form"}
    assert not page.events
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in page.links), page.links
    assert not re.findall(r"url\((?!#)|@import", text)
    assert len(set(page.ids)) == len(page.ids)
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    levels = [int(heading[1]) for heading in page.headings]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    return page
