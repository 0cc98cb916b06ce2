"""Pages of the gallery: the figure stands before the code that draws it, and thumbnails are drawn for their size.

Sphinx-Gallery scales the figure of an example down to its thumbnail, with axes that nobody can read then. Here each figure
is drawn a second time, small: its first axes alone, thick lines, no text. `scraper` does that while the examples run, and
`exchanged` puts the small figures in the place of the scaled ones.
"""

import pickle
import re
import shutil
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from docutils import nodes
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx_gallery.directives import imgsgnode
from sphinx_gallery.scrapers import matplotlib_scraper

SMALL = "small"  # folder of the small figures, beside the thumbnails
SIZE_IN, DPI = (4.8, 3.0), 100
THICKER = 2.5


def scraper(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Save the figures of a block, small ones too; the arguments are Sphinx-Gallery's."""
    images = variables["image_path_iterator"]
    for number, name in enumerate(plt.get_fignums(), len(images) + 1):
        path = Path(images.image_path.format(number))
        small = path.parent / SMALL / path.name
        small.parent.mkdir(exist_ok=True)
        _save_small(pickle.loads(pickle.dumps(plt.figure(name))), small)
    return str(matplotlib_scraper(block, variables, gallery))


def _save_small(figure: Figure, path: Path) -> None:
    first, *others = figure.axes
    for axis in others:
        if (
            not axis.get_shared_x_axes().joined(first, axis)
            or axis.get_position().bounds != first.get_position().bounds
        ):
            axis.remove()
    figure.set_layout_engine("none")
    figure.set_size_inches(SIZE_IN)
    for text in (*figure.texts, *figure.legends):
        text.remove()
    for axis in figure.axes:
        axis.set_position((0.04, 0.05, 0.92, 0.9))
        _without_text(axis)
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def _without_text(axis: Axes) -> None:
    axis.set(title="", xlabel="", ylabel="")
    axis.tick_params(which="both", length=0, labelbottom=False, labelleft=False, labelright=False, labeltop=False)
    if axis.get_legend():
        axis.get_legend().remove()
    for text in list(axis.texts):
        text.remove()
    for line in axis.get_lines():
        line.set_linewidth(THICKER * max(line.get_linewidth(), 0.8))
        line.set_markersize(1.6 * line.get_markersize())


def exchanged(app: Sphinx, *_: Any) -> None:
    """Put small figures in the place of thumbnails; of each example the one that its thumbnail shows."""
    for thumbnail in Path(app.srcdir, "gallery").glob("*/images/thumb/*_thumb.png"):
        stem = thumbnail.name.removesuffix("_thumb.png")
        small = sorted((thumbnail.parents[1] / SMALL).glob(f"{stem}_[0-9]*.png"))
        script = thumbnail.parents[2] / f"{stem.removeprefix('sphx_glr_')}.py"
        chosen = re.search(r"sphinx_gallery_thumbnail_number = (-?\d+)", script.read_text(encoding="utf-8"))
        number = int(chosen.group(1)) if chosen else 1
        if small:
            shutil.copyfile(small[number - 1 if number > 0 else number], thumbnail)


def figure_first(app: Sphinx, tree: nodes.document) -> None:
    """Move every figure of an example before the code that draws it."""
    if not re.match(r"gallery/\w+/plot_", app.env.docname):
        return
    for code in list(tree.findall(nodes.literal_block)):
        holder, at = code.parent, code.parent.index(code)
        following = holder[at + 1 :]
        figures = [node for node in following[: _until_code(following)] if _is_figure(node)]
        for node in figures:
            holder.remove(node)
        holder[at:at] = figures


def _until_code(following: list[nodes.Node]) -> int:
    stops = (nodes.literal_block, nodes.paragraph, nodes.section)
    return next((n for n, node in enumerate(following) if isinstance(node, stops)), len(following))


def _is_figure(node: nodes.Node) -> bool:
    return isinstance(node, imgsgnode) or (isinstance(node, nodes.bullet_list) and any(node.findall(imgsgnode)))


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect both."""
    app.connect("env-before-read-docs", exchanged)
    app.connect("doctree-read", figure_first)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
