"""One HTML file of a figure, with its data, scripts and styles in it. Nothing in it is fetched from elsewhere."""

import base64
import hashlib
import json
from html import escape
from pathlib import Path
from string import Template

from rig.drawing.interactive.panels import contents_of
from rig.drawing.style import Figure

MARK = '<meta name="generator" content="vibrolock">'
"""How a page says what made it."""
PARTS = ("looks", "painting", "hover", "zoom", "panel", "figure")
"""Files of the script, in the order in which they use one another."""


def document(page: Figure) -> str:
    """Return a figure that was laid out as an HTML document.

    Its policy allows its own two scripts, by their digests, and nothing else; what stands in recordings is data, and is
    shown as text.
    """
    contents = contents_of(page)
    library = _file("uplot/uPlot.iife.min.js")
    script = '"use strict";\n(() => {\n' + "\n".join(_file(f"{name}.js") for name in PARTS) + "})();\n"
    return Template(_file("figure.html")).substitute(
        mark=MARK,
        title=escape(contents["title"] or "figure"),
        digests=" ".join(f"'sha256-{_digest(text)}'" for text in (library, script)),
        style=_file("uplot/uPlot.min.css") + _file("figure.css"),
        contents=json.dumps(contents, ensure_ascii=True, allow_nan=False).replace("<", "\\u003c"),
        library=library,
        script=script,
    )


def _file(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
