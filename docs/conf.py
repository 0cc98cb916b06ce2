"""How the documentation site is built: ``sphinx-build -W --keep-going docs rig/site``. Needs the extra ``docs``, no network."""

import sys
from pathlib import Path

from vibrolock import __version__

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

project = "vibrolock"
author = "The vibrolock developers"
version = release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "gallery_pages",
    "mathml",
    "reference",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["driver-template", "_build", "_extensions", "examples"]

myst_enable_extensions = ["colon_fence", "deflist", "attrs_block", "substitution", "dollarmath"]
myst_dmath_allow_space = False  # `$ rig list` and prices stay text
myst_dmath_allow_digits = False
html_math_renderer = "mathml"
myst_heading_anchors = 5

nitpicky = False
smartquotes = False  # options of commands keep their two hyphens
default_role = "py:obj"
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
toc_object_entries = False

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "_static" / "scorer.js")
html_title = f"vibrolock {release}"
html_theme_options = {
    "show_nav_level": 1,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_show_sourcelink = False
html_copy_source = False

# The gallery: `-D plot_gallery=0` makes its pages without running the examples.
SECTIONS = ("first_steps", "tests", "models", "predictions", "virtual_rigs", "on_a_bench")
sphinx_gallery_conf = {
    "examples_dirs": ["examples"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"plot_",
    "subsection_order": [f"examples/{name}" for name in SECTIONS],
    "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True,
    "capture_repr": ("_repr_html_",),
    "reset_modules": ("gallery_style.apply",),
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "write_computation_times": False,
    "min_reported_time": 600,
    "image_scrapers": ("gallery_pages.scraper",),
    "thumbnail_size": (480, 300),
    "log_level": {"backreference_missing": "info"},
}
