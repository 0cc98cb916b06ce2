"""Formulas as MathML, made from LaTeX while the site is built, so that a page needs no script and no network to show them.

Docutils has the converter; Sphinx takes it as the renderer ``mathml`` (``html_math_renderer``). A formula that it cannot
convert is a warning with the reason, and so stops the build.
"""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.logging import getLogger
from sphinx.util.math import get_node_equation_number

log = getLogger(__name__)
DIGITS = re.compile(r"(frac) *(\d) *(\d)")  # 1 over 2 in TeX, where the converter reads the number 12
BAR = re.compile(r"<mo([^>]*)>([|‖])</mo>")  # around an absolute value; browsers give it the space of an operator


def _markup(translator: Any, node: nodes.Node, block: bool) -> str:
    """Return a formula as MathML; its source, with a warning, where it cannot be converted."""
    source = DIGITS.sub(r"\1{\2}{\3}", node.astext())
    several = block and r"\\" in source and r"\begin" not in source
    lines = rf"\begin{{aligned}}{source}\end{{aligned}}" if several else source
    try:
        return BAR.sub(r'<mo\1 lspace="0" rspace="0">\2</mo>', tex2mathml(lines, as_block=block))
    except MathError as error:
        log.warning("formula %r: %s", source, error, location=node)
        return f"<code>{translator.encode(source)}</code>"


def visit_inline(translator: Any, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    translator.body.append(_markup(translator, node, block=False))
    raise nodes.SkipNode


def visit_block(translator: Any, node: nodes.math_block) -> None:
    """Write a formula that stands alone, with its number where it has a label."""
    translator.body.append(translator.starttag(node, "div", CLASS="formula"))
    if node["number"]:
        translator.body.append(f'<span class="eqno">({get_node_equation_number(translator, node)})')
        translator.add_permalink_ref(node, "Link to this equation")
        translator.body.append("</span>")
    translator.body.append(_markup(translator, node, block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the renderer."""
    app.add_html_math_renderer("mathml", inline_renderers=(visit_inline, None), block_renderers=(visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
