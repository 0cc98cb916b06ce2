"""How the documentation site is built: ``sphinx-build -W --keep-going docs rig/site``. Needs the extra ``docs``, no network."""

from pathlib import Path

from vibrolock import __version__

HERE = Path(__file__).parent

project = "vibrolock"
author = "The vibrolock developers"
version = release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["driver-template", "_build"]

myst_enable_extensions = ["colon_fence", "deflist", "attrs_block", "substitution"]
myst_heading_anchors = 5

nitpicky = False
autodoc_typehints = "description"
autodoc_member_order = "bysource"

html_theme = "pydata_sphinx_theme"
html_title = f"vibrolock {release}"
html_static_path = ["_static"]
html_theme_options = {
    "show_nav_level": 2,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_show_sourcelink = False
html_copy_source = False
